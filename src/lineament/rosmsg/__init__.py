"""ROS messages as bytes, read and written: one codec for logs, output and the live node."""

"""lineament as a node of rclpy."""

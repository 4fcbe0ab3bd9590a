"""The kernels of method `optimal`; ``docs/optimal.md`` derives them."""

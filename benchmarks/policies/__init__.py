"""Compare the virtual drag with optimized control laws on one noisy sampled loop."""

"""Record calibrations at the bench, and evaluate what the sensors of a robot recorded."""

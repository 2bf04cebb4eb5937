"""What every other folder stands on: errors, units, checks of numbers, and the letter's equation ids."""

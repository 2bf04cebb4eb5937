"""Run every benchmark: `python -m benchmarks`."""

from . import accuracy, controller, drag, gradients, loops, reading, solving, starting, verdicts

if __name__ == "__main__":
    starting.main()
    reading.main()
    solving.main()
    accuracy.main()
    controller.main()
    loops.main()
    verdicts.main()
    gradients.main()
    drag.main()

"""`python -m benchmarks.step_cost`: what a step costs, beside other programs."""

from pathlib import Path

from jaxcrusher.files.program import program


def main(out: Path = Path("results/step_cost")) -> None:
    """Measure what a step costs beside other programs, and how many it takes; four minutes.

    Every measurement runs in a process of its own, on one core.

    Args:
        out: Folder of step_cost.md, step_cost.csv and step_cost_steps.csv.
    """
    from benchmarks.step_cost.run import run

    run(out)


if __name__ == "__main__":
    program(main)

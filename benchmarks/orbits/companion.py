"""`python -m benchmarks.orbits.companion`: where a loud companion of the quiet motion lives."""

from jaxcrusher.files.program import program


def main() -> None:
    """Follow the motion of two turns over speed and over clearance, both ways; ten minutes."""
    from benchmarks.orbits.window import run

    run()


if __name__ == "__main__":
    program(main)

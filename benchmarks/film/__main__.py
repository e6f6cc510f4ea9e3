"""`python -m benchmarks.film`: films of a bearing beside Reynolds' equation."""

from jaxcrusher.files.program import program


def main() -> None:
    """Print two tables: of steady journals, and of pins that move any way; half a minute."""
    import jaxcrusher as jc
    from benchmarks.film.tables import tables

    jc.set_up()
    for one in tables():
        print(one)


if __name__ == "__main__":
    program(main)

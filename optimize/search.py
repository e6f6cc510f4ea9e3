"""The whole search, from the options to what it leaves behind."""

from dataclasses import asdict, replace

from rich.console import Console

from jaxcrusher.commands.crushers import tell_unusual
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command, versions
from jaxcrusher.files.results import write_json
from jaxcrusher.files.resume import begin
from optimize import figures, landscape, problem, report, settled, stages, verdicts
from optimize.abreast import abreast
from optimize.answer import Answer, Sought
from optimize.claim import claim
from optimize.options import Options
from optimize.page.document import write_page

WRITTEN = ("result.json", "report.html", "settled.nc", "landscape.nc", "*.png")


def run(options: Options, console: Console) -> Answer:
    """Search, and write result.json, landscape.nc, figures and page; what came, if interrupted.

    A box of which no design may be chosen is an answer too: it says why. The status is "finished"
    only after page and figures are written.
    """
    problem.check(options)
    case = problem.case(options)
    tell_unusual(problem.description(options))
    folder = begin(options.folder, problem.settings(options), *WRITTEN)
    answer = Answer(
        command=command(),
        versions=versions("scipy"),
        objective=Sought(options.objective, case.objective.unit, case.objective.meaning),
        box=problem.box(case, options),
        fixed=dict(case.design.fixed),
        settle_turns=stages.LONGER * options.settle,
        compared_with=problem.reference_title(options),
        seed=options.seed,
    )
    units = landscape.points(case.design, options.grid, options.samples, options.seed)
    points = landscape.points(case.design, options.cells, options.samples, options.seed)
    explored = None
    try:
        with progress(console) as bars:
            search = stages.Search(case, options, bars)
            orbits, (data, motions) = abreast(
                search.stop,
                lambda: stages.map_orbits(search, answer, points, folder),
                lambda: stages.explore(search, answer, units, folder),
            )
            explored = data
            answer = replace(answer, orbits=settled.count(orbits))
            ends, answer = stages.refine(search, answer, units, data, points, orbits)
            answer, best = stages.settle_on(search, answer, ends)
            if best is not None:
                answer = replace(answer, optimum=best, claim=claim(case, orbits, best))
                answer = stages.weigh(search, answer, best)
                answer = stages.trade(search, answer, best, points, orbits)
        checks = verdicts.checks(answer, case, options)
        remarks = (
            verdicts.remark(best, case, options),
            verdicts.quieter(answer, case, points, orbits),
        )
        remark = " ".join(filter(None, remarks))
        done = replace(answer, checks=checks, remark=remark, status="finished")
        drawn, omitted = figures.draw_all(folder, case, units, data, points, orbits, done)
        write_page(folder, done, data, motions, drawn, omitted)
        answer = done
    except Exception as error:
        answer = replace(answer, status=f"failed: {error}")
        raise
    finally:
        write_json(folder / "result.json", asdict(answer))
        if not answer.finished:
            write_page(folder, answer, explored, None, ())
    report.print_table(console, answer)
    console.print(f"results in {folder}/")
    return answer

"""The whole search, from the options to what it leaves behind."""

from dataclasses import replace

from rich.console import Console

from jaxcrusher.files.journal import Journal
from jaxcrusher.files.progress import progress
from jaxcrusher.files.provenance import command, versions
from jaxcrusher.files.results import write_json
from jaxcrusher.files.resume import begin
from jaxcrusher.scenes.plausibility import tell_borrowed, tell_unusual
from optimize import figures, landscape, report, result_file, stages, verdicts
from optimize.active import active_constraints
from optimize.answer import Answer
from optimize.bound import optimality_bound
from optimize.concurrent import run_concurrently
from optimize.options import Options
from optimize.orbits import count_stable
from optimize.page.document import write_page
from optimize.problem import resolve

WRITTEN = ("result.json", "report.html", "orbits.nc", "landscape.nc", "*.png")
# Finished chunks of a search that is not finished.
CHUNKS = "chunks"


def run(options: Options, console: Console) -> Answer:
    """Search, and write result.json, maps, figures and page; what there is, if interrupted.

    A search that was interrupted goes on from its finished chunks. A box of which no design may be
    chosen is an answer too: it says why. The status is "finished" only after page and figures are
    written.
    """
    problem = resolve(options)
    tell_unusual(problem.described)
    tell_borrowed({**problem.described, **problem.reference}, options.scene)
    folder = begin(problem.folder, problem.settings, *WRITTEN)
    journal = Journal(folder / CHUNKS)
    case, effort, explored = problem.case, problem.effort, None
    answer = Answer(
        command=command(),
        versions=versions("scipy"),
        objective=problem.sought,
        box=problem.box,
        fixed=dict(case.design.fixed),
        settle_turns=stages.LONGER * effort.settle,
        compared_with=problem.compared_with,
        bulk_density=problem.bulk_density,
        seed=effort.seed,
    )
    units = landscape.points(case.design, effort.grid, effort.samples, effort.seed)
    points = landscape.points(case.design, effort.cells, effort.samples, effort.seed)
    with progress(console) as bars:
        work = stages.Work(folder, bars, journal)
        try:
            mapped, (data, motions) = run_concurrently(
                work.stop,
                lambda: stages.map_orbits(problem, work, points),
                lambda: stages.explore(problem, work, units),
            )
            explored = data
            answer = replace(answer, stable_orbits=count_stable(mapped))
            refined = stages.refine(problem, work, units, data, points, mapped)
            answer = replace(answer, refinement=refined.descents, empty=refined.empty)
            found = stages.confirm(problem, work, refined.candidates)
            answer = replace(
                answer,
                candidates=found.candidates,
                seed_choice=found.reference,
                empty=answer.empty or found.empty,
            )
            best = found.best
            if best is not None:
                runs = stages.run_open_points(problem, work, points, mapped)
                bound = optimality_bound(case, mapped, best, runs)
                answer = replace(answer, optimum=best, bound=bound)
                designs = stages.with_coexisting_orbits(problem, work, (best, found.reference))
                (best, reference), slopes = stages.with_regimes(problem, work, designs)
                active, free_slopes = active_constraints(case, best)
                answer = replace(
                    answer,
                    optimum=best,
                    seed_choice=reference,
                    gradient_report=slopes,
                    active=active,
                    free_slopes=free_slopes,
                )
                answer = replace(answer, load_sheets=stages.load_sheets(answer.designs))
                answer = replace(answer, fronts=stages.trade(problem, work, best, points, mapped))
            remarks = (
                verdicts.remark(best, problem),
                verdicts.quieter(answer, case, points, mapped),
            )
            done = replace(
                answer,
                checks=verdicts.checks(answer, problem),
                remark=" ".join(filter(None, remarks)),
                status="finished",
                seconds=work.seconds,
                steps=work.steps,
            )
            drawn, omitted = figures.draw_all(folder, case, units, data, points, mapped, done)
            write_page(folder, done, data, motions, drawn, omitted)
            answer = done
        except Exception as error:
            answer = replace(answer, status=f"failed: {error}")
            raise
        finally:
            answer = replace(answer, seconds=work.seconds, steps=work.steps)
            write_json(folder / "result.json", result_file.content(answer))
            if not answer.finished:
                write_page(folder, answer, explored, None, ())
    journal.discard()
    report.print_answer(console, answer)
    console.print(f"results in {folder}/")
    return answer

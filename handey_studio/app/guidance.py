"""What to do next, said in one sentence for every state that the workbench can be in."""

from handey_studio.app import html
from handey_studio.app.jobs import CANCELLED, FIRST_JOB
from handey_studio.app.state import Job, State
from handey_studio.session.run import PLANNED, SENSED
from handey_studio.task.move import UNSURE
from handey_studio.task.plan import MoveResult

FIRST = "(The first job after an installation takes a minute or two longer: its code is compiled, once.)"
UNSEEN = "By the arm's joints the part is where it was to be; no scan sees that place."
CLEAR = "Clear what hides it, or turn it; Located tells what was nearly taken for it."
STAGES = (("Sense", 0.0), ("Plan", SENSED), ("Execute", PLANNED))


def stages(job: Job) -> list[tuple[str, str]]:
    """Each stage of a MOVE and whether it is done, now or later; other jobs have none."""
    if job.done is not None:
        return []
    named = STAGES if job.execute else STAGES[:2]
    ends = [start for _, start in named[1:]] + [1.01]
    return [
        (name, "done" if job.fraction >= end else "now" if job.fraction >= start else "later")
        for (name, start), end in zip(named, ends, strict=True)
    ]


def next_step(state: State) -> tuple[str, str, str]:
    """(title, sentence, tone)."""
    session, job = state.session, state.job
    if job is not None:
        what = "Stopping" if job.cancelling else job.title or ("Moving" if job.execute else "Planning")
        first = f" {FIRST}" if job.number == 1 and job.message != FIRST_JOB else ""
        return f"{what} …", f"{html.sentence(job.message)}{first}", "info"
    if not session.workcell.parts:
        return "This workcell has no part models", "Model one of what lies in the cell (Model, on the left), or open a session.", "quiet"
    if state.command is None:
        return "Choose a part", "Pick the part that the arm shall move, below.", "info"
    result = session.result
    if result is None:
        return _before_the_move(state, state.command.part)
    if result.command != state.command:
        return "The command has changed", "What is shown belongs to the MOVE before. Press Plan or MOVE for the new one.", "info"
    if result.reason == CANCELLED:
        return "Cancelled", "What was found so far is shown. Press Plan or MOVE to start again.", "quiet"
    if result.status == "failed":
        if result.performances:
            return "It was not done", f"{_sentence(result.reason)} What happened is told on the right, under Result.", "bad"
        return "No plan was found", f"{_sentence(result.reason)} {_way_out(result.reason)}", "bad"
    if result.status == "planned":
        return "Planned: look before it moves", "Play or scrub the timeline. MOVE carries it out.", "good"
    if unseen(result):
        return "Done, as far as can be told", f"{UNSEEN} Choose where it goes next, or save the session.", "good"
    return "Done", "The part was moved. Choose where it goes next, or save the session.", "good"


def _before_the_move(state: State, part: str) -> tuple[str, str, str]:
    """What to do before anything was planned: the cell may have been searched already, and not have shown the part."""
    scene = state.session.scene
    found = scene is None or any(part in (placed.name, placed.part.name) for placed in scene.instances)
    if found:
        return "Ready to MOVE", "Check the destination, then press Plan to look before anything moves, or MOVE to do it.", "info"
    return f"{part} was not found", f"{CLEAR} Plan and MOVE scan again.", "bad"


def unseen(result: MoveResult) -> bool:
    """Whether no scan afterwards could see where a part was put."""
    check = result.performance.check if result.performance is not None else None
    return check is not None and check.found == "hidden"


def _way_out(reason: str) -> str:
    """What may help where there is no plan."""
    if reason.startswith(UNSURE):
        return "No destination helps: this view does not tell how it stands. Turn it over, or onto another side, and scan again."
    if "was not found in the scan" in reason:
        return CLEAR
    return "The ledger tells what was tried; another destination may do."


def _sentence(reason: str) -> str:
    """A reason as a sentence of its own."""
    return f"{html.sentence(reason).rstrip('.')}."

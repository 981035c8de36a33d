"""What to do next with the model, said in one sentence for every state that it can be in; and what the active tool waits for."""

from handey_studio.app.modelling import derived
from handey_studio.app.modelling.look import BY_HEIGHT, POINTS, SELECT, TO_FACE, MeshImport
from handey_studio.app.modelling.plane_tools import measurement, tool_plane
from handey_studio.app.modelling.tool_clicks import BOX, CUT, EXTRUDE, MEASURE, MIRROR, SKETCH
from handey_studio.app.state import State
from handey_studio.base import measured
from handey_studio.modeling.scans import Scan
from handey_studio.session.model_look import assumed_faces, proposals, unaligned

BOX_CLICKS = ("a corner of the box's upper face", "the next corner along a side of it", "a point on the side across")


def model_step(state: State) -> tuple[str, str, str]:
    """(title, sentence, tone)."""
    draft, job = derived.draft_of(state), state.job
    if job is not None:
        return f"{job.title or 'Planning'} …", job.message, "info"
    if state.model.reading is not None:
        return "Reading the scan …", f'"{state.model.reading.name}" is read, and the plane that the object stands on is looked for.', "info"
    if state.model.mesh is not None:
        return _about_mesh(state.model.mesh)
    if state.model.waiting is not None:
        wanted = "depth image (PNG)" if state.model.waiting.name.lower().endswith("json") else "camera (JSON)"
        return "One more file", f'Upload the {wanted} that belongs to "{state.model.waiting.name}".', "info"
    if draft is None and state.session.draft is not None:
        return f"The model of {state.session.draft.name}", "Continue it, or go on with a MOVE.", "quiet"
    if draft is None:
        words = "Scan the cell or upload a scan of an object: its faces are found, and a solid is suggested. Or import a mesh."
        return "Model a part", words, "info"
    if state.model.trial is not None:
        return _about_trial(state, state.model.trial)
    if state.model.tool != SELECT:
        return tool_step(state)
    return _with_scans(state) if derived.to_segment(state) is None else ("Looking for planar faces …", "In the new scan.", "info")


def _with_scans(state: State) -> tuple[str, str, str]:
    draft, shown = derived.draft_of(state), derived.built(state)
    if draft is None or shown is None:
        return "", "", "quiet"
    scan = unaligned(draft)
    if scan is not None:
        return _about_alignment(state, scan.name)
    if derived.to_suggest(state) is not None:
        told = _about_suggestion(state)
        if told is not None:
            return told
    if shown.solid is None:
        return "Nothing is modelled yet", "Click an object in the scan, or draw it: box from three clicks, or a sketch to extrude.", "info"
    fallen = [step for step in shown.steps if step.reason]
    if fallen:
        return f"Step {fallen[0].number + 1} can no longer be done", f"{fallen[0].reason}", "bad"
    if state.model.step is not None:
        return f"As after step {state.model.step}", "Click the step again to see the whole model.", "quiet"
    return _about_solid(state)


def _about_mesh(mesh: MeshImport) -> tuple[str, str, str]:
    """What is asked of a file that is to be imported."""
    if mesh.refusal:
        return "Not a part as it is", mesh.refusal, "bad"
    if mesh.upload.tells_unit or not mesh.extents:
        return "Reading the mesh …", f'"{mesh.upload.name}": its triangles, its bodies, its planar faces.', "info"
    return "In which unit are its numbers?", f'"{mesh.upload.name}" does not say. Choose the size that it has, then Import it.', "info"


def _about_trial(state: State, scan: Scan) -> tuple[str, str, str]:
    """Whether the model was found in another scan."""
    found = derived.tried(state)
    if found is None:
        failed = derived.is_worked(state, derived.TRIAL, derived.to_try(state))
        words = "The localizer failed; the log tells why." if failed else f'In "{scan.source}", by its edges and surfaces.'
        return "Looking for the model …", words, "bad" if failed else "info"
    if not found.poses:
        return "Not found there", f"{found.reason}", "bad"
    best = found.poses[0]
    times = f"{len(found.poses)} times, best" if len(found.poses) > 1 else "once,"
    words = f"{times} with a probability of {100 * best.score:.0f} % and {1e3 * best.surface_rms_m:.1f} mm rms."
    return "Found there", _capital(words), "good"


def _about_alignment(state: State, name: str) -> tuple[str, str, str]:
    found = derived.alignment(state)
    if not derived.is_worked(state, derived.ALIGNMENT, derived.to_align(state)):
        return f"Aligning {name} …", "By the planes that it shares with the scans before.", "info"
    offered = proposals(found)
    if found is None or not offered:
        reason = found.reason if found is not None else "the alignment failed"
        return f"{_capital(name)} could not be aligned", f"{reason}. Use Align points: pairs of clicks on both scans.", "bad"
    more = f" {len(offered)} poses fit; this is number {state.model.alternative % len(offered) + 1}." if len(offered) > 1 else ""
    return (
        f"{_capital(name)} is aligned within {1e3 * found.rms:.2f} mm",
        f"Shown in another colour. Accept it, or pick points.{more}",
        "good",
    )


def _capital(name: str) -> str:
    return name[:1].upper() + name[1:]


def _about_suggestion(state: State) -> tuple[str, str, str] | None:
    if not derived.is_worked(state, derived.SUGGESTION, derived.to_suggest(state)):
        return "Suggesting a model …", "From the faces that the scans show.", "info"
    found = derived.suggestion(state)
    if found is None or found.solid is None:
        reason = found.reason if found is not None else "nothing could be suggested"
        return "No model is dared", f"{reason}. Click another object, take another scan, or draw it with the tools.", "quiet"
    assumed = len(assumed_faces(found.sources))
    told = f"{len(found.solid.faces)} faces, {assumed} of them assumed (hatched); {100 * found.explained:.0f} % of its readings explained."
    return "A model is suggested", f"{told} Take it, or click another object.", "good"


def _about_solid(state: State) -> tuple[str, str, str]:
    shown, judged = derived.built(state), derived.truth(state)
    broken = next((check for check in judged.checks if not check.ok), None) if judged is not None else None
    if broken is not None:
        return "Not yet a part", f"{broken.sentence} {broken.fix}", "bad"
    if judged is not None and judged.doubts:
        return "The scans disagree", f"{judged.doubts[0].sentence} {judged.doubts[0].fix}", "warn"
    assumed = len(assumed_faces(shown.sources)) if shown is not None else 0
    if assumed:
        words = f"{assumed} side{'s are' if assumed > 1 else ' is'} assumed"
        return words, "Take another scan, confirm them one by one, or go on: save the part, or find it.", "info"
    return "The model is complete", "Save it as a part, or press Find it and MOVE it right away.", "good"


def tool_step(state: State) -> tuple[str, str, str]:
    """What the active tool waits for."""
    tool, clicks = state.model.tool, state.model.clicks
    if tool == BOX:
        return "Box", f"Click {BOX_CLICKS[min(len(clicks), 2)]}.", "info"
    if tool == SKETCH:
        return "Sketch", _sketch_words(state), "info"
    if tool == EXTRUDE:
        far = state.model.settings.far
        if far == TO_FACE:
            return "Extrude", "Click the face or patch that it goes to.", "info"
        return "Extrude", "Type the height and press Extrude (Enter)." if far == BY_HEIGHT else "Press Extrude (Enter).", "info"
    if tool in (CUT, MIRROR):
        title = "Cut by a plane" if tool == CUT else "Mirror"
        if tool_plane(state) is not None:
            return title, "Move the plane by its offset, turn it round, then press the button (Enter).", "info"
        left = f"; {3 - len(clicks)} more points" if clicks else ""
        return title, f"Click a face whose plane is meant, or three points of a plane{left}.", "info"
    told = measurement(state)
    if told is not None:
        return (
            measured(told.value, told.unit),
            f"{told.sentence[0].upper()}{told.sentence[1:]}. Click again to measure something else.",
            "good",
        )
    if tool == MEASURE:
        return "Measure", "Click the second thing." if len(clicks) == 1 else "Click two things: corners, edges, faces or readings.", "info"
    if tool == POINTS:
        where = "on the scans that are aligned" if len(clicks) % 2 == 0 else "the same point on the new scan"
        return "Align by points", f"Pair {len(clicks) // 2 + 1}: click {where}. Three pairs are enough.", "info"
    return "", "", "quiet"


def _sketch_words(state: State) -> str:
    drawing = state.model.drawing
    if drawing is None:
        return "Click the face, the patch or the support to draw on."
    count = len(drawing.stroke.clicks)
    if count < 3:
        return f"Click corner {count + 1} of the outline."
    return f"Click corner {count + 1}, or the first one to close the outline (Enter)."

"""Programs as URScript: one servoj a tick, the gripper as two functions that the user fills in, descents that end on contact.

Nothing of the plan's file is written but numbers and names that were checked; every text that the controller shows is our own.
"""

import re

import numpy as np

from handey_studio.base import BadInput
from handey_studio.task.export.program import Program, ProgramStep, check_names, kind_of
from handey_studio.world import Robot, arm_of

RATES_HZ = (125.0, 500.0)  # CB series, e-Series
GUARDED_SHARE = 0.25  # of its planned speed has the descent that ends on contact
TOUCH_N = 10.0  # beyond what the controller's estimate of the tool's force wanders by at these speeds
EARLY_M = 0.004  # contact so far above the commanded end of a descent is something else than the support
MARK = "# handey-urscript/1"

HEAD = """\
def handey_program():
  # Fill in these two for your gripper; both return when the fingers have stopped. Openings in metres between the fingers.
  def hand_to(opening_m):
    textmsg("hand_to, metres: ", opening_m)
    sleep(1.0)
  end
  # Close on the part, which is this wide, with at most this force in newtons; False when the fingers closed on nothing.
  def hand_grip(width_m, force_N):
    textmsg("hand_grip, metres: ", width_m)
    sleep(1.0)
    return True
  end

  # Nothing below needs a change. Set the tool's payload and centre on the controller; stay at the emergency stop.
  global handey_touched = False
  global handey_ticks = 0
  global handey_felt = get_tcp_force()
  def handey_stop(why):
    stopj(2.0)
    popup(why, "Handey", False, True, True)
    halt
  end
  def handey_begin(q):
    local here = get_actual_joint_positions()
    local i = 0
    while i < 6:
      if norm(here[i] - q[i]) > {near}:
        handey_stop("The arm does not stand where this step begins.")
      end
      i = i + 1
    end
  end
  def handey_go(q):
    servoj(q, 0, 0, {tick}, 0.1, 300)
  end
  def handey_arrive(q):
    local i = 0
    while i < {patience}:
      servoj(q, 0, 0, {tick}, 0.1, 300)
      i = i + 1
    end
    stopj(2.0)
  end
  def handey_feel():
    handey_touched = False
    handey_ticks = 0
    sleep(0.2)
    handey_felt = get_tcp_force()
  end
  def handey_down(q):
    if not handey_touched:
      servoj(q, 0, 0, {tick}, 0.1, 300)
      local now = get_tcp_force()
      local x = now[0] - handey_felt[0]
      local y = now[1] - handey_felt[1]
      local z = now[2] - handey_felt[2]
      handey_touched = sqrt(x * x + y * y + z * z) > {touch}
      handey_ticks = handey_ticks + 1
    end
  end
  def handey_landed(least):
    stopj(2.0)
    if not handey_touched:
      handey_stop("No contact by the end of the descent.")
    end
    if handey_ticks < least:
      handey_stop("Contact too early in the descent.")
    end
  end
  def handey_lead(q):
    movej(q, a=0.5, v=0.1)
  end

"""
SETTLE_S, BEGIN_RAD = 0.3, 0.02
ANGLES = re.compile(r"\[([-0-9.,]+)\]\)$")


def urscript(program: Program, robot: Robot, rate_hz: float) -> str:
    """The program, whose moving steps are in ticks of 1 / rate (`at_rate`), for a Universal Robots arm.

    Each step first makes sure that the arm stands where it begins; after a descent, which may end a little above or below, the arm is led
    to the next step's beginning slowly. Raises BadInput for other arms and rates.
    """
    if robot.ik != "ur" or len(program.joint_names) != 6:
        raise BadInput(f'URScript drives Universal Robots arms; robot "{robot.name}" is none, so export ros2 or csv.')
    if rate_hz not in RATES_HZ:
        raise BadInput(f"URScript runs at {' or '.join(f'{rate:g}' for rate in RATES_HZ)} Hz, not at {rate_hz:g} Hz.")
    lines = [f"{MARK} robot={program.robot} rate_hz={rate_hz:g} joints={','.join(program.joint_names)}\n"]
    lines.append(HEAD.format(tick=f"{1 / rate_hz:g}", touch=f"{TOUCH_N:g}", near=f"{BEGIN_RAD:g}", patience=round(SETTLE_S * rate_hz)))
    after_descent = False
    for number, step in enumerate(program.steps, start=1):
        lines += _step(number, step, robot, after_descent)
        after_descent = step.kind == "place" or (after_descent and not step.moves_arm)
    return "".join([*lines, "end\n"])


def _step(number: int, step: ProgramStep, robot: Robot, led: bool) -> list[str]:
    lines = [f"  # step {number} {step.kind} {len(step.time_s)} {_number(float(step.time_s[-1]))} {_number(float(step.opening_m[0]))}\n"]
    if not step.moves_arm:
        return [*lines, *_hand(step, robot)]
    first, last = _angles(step.q_rad[0]), _angles(step.q_rad[-1])
    lines.append(f"  handey_lead({first})\n" if led else f"  handey_begin({first})\n")
    if step.kind != "place":
        return [*lines, *(f"  handey_go({_angles(q)})\n" for q in step.q_rad), f"  handey_arrive({last})\n"]
    heights = arm_of(robot).hand_pose(step.q_rad)[:, 2, 3]
    least = int(np.argmax(heights - heights[-1] <= EARLY_M))
    return [*lines, "  handey_feel()\n", *(f"  handey_down({_angles(q)})\n" for q in step.q_rad), f"  handey_landed({least})\n"]


def _hand(step: ProgramStep, robot: Robot) -> list[str]:
    """`close` grips; any other change of the opening is a mere motion of the fingers."""
    opening = _number(float(step.opening_m[-1]))
    if step.kind != "close":
        return [f"  hand_to({opening})\n"]
    return [f"  if not hand_grip({opening}, {robot.hand.force:g}):\n", '    handey_stop("The fingers closed on nothing.")\n', "  end\n"]


def _angles(q) -> str:
    return f"[{','.join(map(_number, q.tolist()))}]"


def _number(value: float) -> str:
    return f"{value:.9f}"


def read_urscript(text: str) -> Program:
    """The program that `urscript` wrote, to the nine decimals that it writes; a step of the fingers has its arm where the one before left
    it. Raises BadInput for a text that is something else."""
    head = text.split("\n", 1)[0]
    match = re.fullmatch(rf"{re.escape(MARK)} robot=(\w+) rate_hz=([0-9.]+) joints=([\w,]+)", head)
    if match is None:
        raise BadInput(f'it is no program of ours: its first line must begin with "{MARK}".')
    robot, rate, names = match[1], float(match[2]), tuple(match[3].split(","))
    check_names(robot, names)
    blocks = re.split(r"(?m)^  # step ", text)[1:]
    turns = [_ticks_of(block) for block in blocks]
    here = next((q[0] for q in turns if len(q)), None)
    if here is None:
        raise BadInput("it is a program in which the arm never moves.")
    steps = []
    for number, (block, q) in enumerate(zip(blocks, turns, strict=True), start=1):
        steps.append(_read_step(number, block, q, here, rate))
        here = steps[-1].q_rad[-1]
    return Program(robot, names, tuple(steps))


def _ticks_of(block: str) -> np.ndarray:
    """The angles (n, 6) that a step's ticks command; empty where only the fingers move."""
    lines = [line for line in block.splitlines() if line.startswith(("  handey_go(", "  handey_down("))]
    found = [ANGLES.search(line) for line in lines]
    if not all(found):
        raise BadInput("a tick of the program has no list of angles.")
    return np.array([[float(word) for word in match[1].split(",")] for match in found if match])


def _read_step(number: int, block: str, q: np.ndarray, here: np.ndarray, rate: float) -> ProgramStep:
    words = block.split("\n", 1)[0].split()
    if len(words) != 5 or words[0] != str(number) or (len(q) and words[2] != str(len(q))):
        raise BadInput(f"step {number} of the program begins with {block[:60]!r}.")
    opening = float(words[4])
    if len(q):
        return ProgramStep(kind_of(words[1]), np.arange(len(q)) / rate, q, np.full(len(q), opening))
    last = re.search(r"hand_(?:to|grip)\(([0-9.]+)", block)
    if last is None:
        raise BadInput(f"step {number} of the program moves neither arm nor fingers.")
    return ProgramStep(kind_of(words[1]), np.array([0.0, float(words[3])]), np.array([here, here]), np.array([opening, float(last[1])]))

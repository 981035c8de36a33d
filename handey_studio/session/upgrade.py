"""Sessions of earlier formats, brought to this one as plain values, before anything is made of them."""

from typing import Any

NEW = {"first_step": 0, "lifting": None, "lowering": None}  # of a carry, which format 1 had not
CARRY = ("T_world_part_start", "T_world_part_goal", "grasp", "approach", "space")


def upgraded(plain: dict[str, Any]) -> dict[str, Any]:
    """Format 1 had plans of one carry, whose values stood in the plan itself; format 2 had no model in the making. What is not as expected
    is left for the checks to refuse."""
    results = plain.get("results")
    return plain | {"results": [_result(result) for result in results]} if isinstance(results, list) else plain


def _result(result: Any) -> Any:
    plan = result.get("plan") if isinstance(result, dict) else None
    if not isinstance(plan, dict) or "carries" in plan:
        return result
    carry = {key: plan[key] for key in CARRY if key in plan}
    kept = {key: value for key, value in plan.items() if key not in (*CARRY, "regrasps")}
    return result | {"plan": kept | {"carries": [carry | NEW]}}

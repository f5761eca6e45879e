"""The command that describes a model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from tripwatt.command.options import Answer, argument
from tripwatt.command.printing import change, print_table
from tripwatt.errors import InvalidInput


def inspect(
    model: Annotated[Path | None, argument("MODEL", "Folder of a model. Default: the bundled model.")] = None,
) -> Answer:
    """Show the inputs, the provenance and the scores of a model, and verify its checksums.

    For example:

      # describe the bundled model
      tripwatt inspect
      # print all metadata of your model
      tripwatt inspect my-model --json
    """
    from tripwatt.forecasting import load_metadata

    about = load_metadata(model)
    try:
        facts, inputs = _about_rows(about), _input_rows(about)
    except (LookupError, TypeError, ValueError, AttributeError) as error:  # digests are no signatures
        got = f"{type(error).__name__}: {error}"[:200]
        allowed = "metadata of a model of one car, as `tripwatt fit` writes them"
        raise InvalidInput.of("metadata cannot be read", f"{model}", got, allowed) from error

    def shown() -> None:
        print_table("Model", ("", "value"), facts, folding=("value",))
        print_table("Inputs", ("input", "unit", "allowed", "range in training", "required"), inputs)

    return Answer(about, shown)


def _input_rows(about: dict[str, Any]) -> list[tuple[str, ...]]:
    return [
        (
            entry["name"],
            entry["unit"],
            _range(entry["minimum"], entry["maximum"]),
            _range(*entry["training"]) if "training" in entry else "",
            ("yes" if entry["required"] else "no")
            + (", first sample" if entry["samples"] == "first" else ""),
        )
        for entry in about["contract"]["inputs"]
    ]


def _about_rows(about: dict[str, Any]) -> list[tuple[str, str]]:
    fitted, origin, figures = about["model"], about["provenance"], about["evaluation"]
    rows = [
        ("format", f"{about['format_version']}, written by tripwatt {about['tripwatt']}"),
        ("car", f"{fitted['vehicle_title']} ({fitted['vehicle']}, preset {fitted['vehicle_preset']})"),
        ("corrector", f"{fitted['corrector']}, seed {fitted['seed']}, {fitted['trips']} trips"),
    ]
    if "data" in origin:
        rows.append(("data", f"{origin['data']['name']}, SHA-256 {origin['data']['sha256']}"))
        rows += [("citation", origin["data"]["citation"])] if origin["data"]["citation"] else []
        rows += [("note", note) for note in origin["data"]["notes"]]
    if "adapted" in origin:
        rows += _adapted_rows(origin)
    if "mape" in figures:
        errors = (
            f"mean error {figures['mape']:.1%}, RMSE {figures['rmse_wh'] / 1000.0:.3f} kWh, "
            f"bias {figures['bias_wh']:+.0f} Wh on {figures['trips']} trips, {figures['given']}"
        )
        rows += [("held-out trips", errors), ("protocol", figures["protocol"])]
    parts = (f"{name} ({part['bytes']} bytes)" for name, part in about["parts"].items())
    return [*rows, ("parts", ", ".join(parts))]


def _adapted_rows(origin: dict[str, Any]) -> list[tuple[str, str]]:
    """Return rows on the origin of an adapted model and on the changes by its own trips."""
    how, base = origin["adapted"], origin["base"]
    changes = [
        f"{name.replace('_', ' ')} {change(value, 'change')} (± {change(value, 'sd', sign='')})"
        for name, value in how["parameters"].items()
    ]
    about = base["model"]
    model = f"{about['vehicle_title']}, {about['corrector']}, {about['trips']} trips"
    return [
        ("base", f"{model}, SHA-256 {base['sha256']}"),
        ("adapted", f"with {how['trips']} own trips"),
        ("car against its simulation", ", ".join(changes)),
    ]


def _range(low: float | None, high: float | None) -> str:
    return f"{'-' if low is None else f'{low:g}'} to {'-' if high is None else f'{high:g}'}"

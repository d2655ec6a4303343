#!/usr/bin/env python3
"""The tables of a benchmark from its JSON, which `benchmarks` writes: tables.py [FILE] (standard input without one)."""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from statistics import fmean, stdev
from typing import Any

STRONG = 2.0  # strength in detection limits from which an effect must be named
CLASSES = (("< 0.5", 0.0, 0.5), ("0.5…1", 0.5, 1.0), ("1…2", 1.0, 2.0), ("2…5", 2.0, 5.0), ("≥ 5", 5.0, math.inf))
SAMPLES = (("1 … 4", 1, 4), ("8 … 512", 8, 512), ("1,024 … 8,192", 1024, 8192), ("above", 8193, math.inf))
# A text that only one kind of sentence under "Contradicted" contains, and the row of the table for that kind.
SENTENCES = {
    "standard errors": "… at τ = …: σ is … the model (… standard errors)",
    "smaller error than it has": "a Kalman filter with the models of … claims a smaller error than it has",
}
TOLERANCE = 1.5  # largest ratio of two errors on unseen data that count as equally good
FAILS = 3.0  # deviance per point of a model that fails


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Prints columns as wide as their cells, the first one to the left."""
    cells = [[str(cell) for cell in row] for row in (head, *rows)]
    widths = [max(len(cell) for cell in column) for column in zip(*cells, strict=True)]
    for row in cells:
        print(row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)), sep="  ")
    print()


def share(cases: Iterable[bool]) -> tuple[int, int]:
    """The number of true cases, and the number of all cases."""
    cases = list(cases)
    return sum(cases), len(cases)


def cell(cases: Iterable[bool]) -> str:
    yes, count = share(cases)
    return f"{yes}/{count}" if count else "–"


def percent(cases: Iterable[bool]) -> str:
    yes, count = share(cases)
    return f"{100 * yes / count:.1f} %   ({yes} of {count})" if count else "–"


def quantile(values: Iterable[float], level: float) -> float | None:
    """The smallest value that the fraction `level` does not exceed."""
    ordered = sorted(values)
    return ordered[max(math.ceil(level * len(ordered)) - 1, 0)] if ordered else None


def median(values: Iterable[float | None]) -> str:
    middle = quantile((value for value in values if value is not None), 0.5)
    return "–" if middle is None else f"{middle:.2f}"


def counted(names: Iterable[str]) -> str:
    return ", ".join(f"{name} × {count}" for name, count in sorted(Counter(names).items()))


def in_order(values: Iterable[Any]) -> list[Any]:
    """Each value once, in the order of its first occurrence."""
    return list(dict.fromkeys(values))


def summary(lines: dict[str, Iterable[bool]]) -> None:
    for text, cases in lines.items():
        print(f"{text:<60}{percent(cases)}")


def is_near(estimate: dict[str, Any]) -> bool:
    return bool(estimate["relative_error"] <= (0.02 if estimate["name"] in ("frequency", "rate_hz") else 0.1))


def is_covered(estimate: dict[str, Any]) -> bool:
    return bool(estimate["low"] <= estimate["truth"] <= estimate["high"])


def undeclared(result: dict[str, Any]) -> None:
    groups = [("single" if isinstance(group, dict) and "single" in group else group, of) for group, of in result["outcomes"]]
    records = [of for _, of in groups]
    singles = [of for group, of in groups if group == "single"]
    answers = [answer for of in singles for answer in of["answers"]]
    strong = [answer for answer in answers if answer["strength"] >= STRONG]
    of_strong = [of for of in singles if all(answer["strength"] >= STRONG for answer in of["answers"])]
    estimates = [estimate for of in of_strong for estimate in of["estimates"]]
    outside = [of for of in records if of["outside"]]
    kinds = in_order(answer["kind"] for answer in answers)

    print('Named, by strength (size over the detection limit). "Waveform given": detected by a test that is given channel and')
    print("waveform of the effect, and has to estimate the noise.\n")
    rows: list[list[object]] = []
    for kind in kinds:
        own = [answer for answer in answers if answer["kind"] == kind]
        by_class = [cell(a["named"] for a in own if low <= a["strength"] < high) for _, low, high in CLASSES]
        given = cell(a["shape_known"] for a in own if a["strength"] >= STRONG and a["shape_known"] is not None)
        rows.append([kind, *by_class, given])
    table(["", *(name for name, _, _ in CLASSES), "≥ 2, waveform given"], rows)

    print("Confusion: strong effects (rows), and the effects that were named in their channels (columns)\n")
    named = {kind: Counter(kind if a["named"] else a["instead"] or "none" for a in strong if a["kind"] == kind) for kind in kinds}
    columns = [*kinds, *sorted(set().union(*named.values()) - {*kinds, "none"}), "none"]
    table(["", *(name[:9] for name in columns)], ([kind, *(named[kind][name] or "." for name in columns)] for kind in kinds))

    print("Parameters of strong effects that were named\n")
    rows = []
    for kind, name in sorted({(estimate["kind"], estimate["name"]) for estimate in estimates}):
        own = [estimate for estimate in estimates if (estimate["kind"], estimate["name"]) == (kind, name)]
        errors = [100 * (quantile((estimate["relative_error"] for estimate in own), level) or 0.0) for level in (0.5, 0.9)]
        shares = [cell(map(is_near, own)), cell(map(is_covered, own))]
        rows.append([f"{kind} {name}", len(own), *(f"{error:.2f} %" for error in errors), *shares])
    table(["", "number", "median error", "90 % within", "accurate", "coverage"], rows)

    print("Deviance per point on unseen data, medians over strong effects\n")
    unseen = [(of["answers"][0]["kind"], of["unseen"]) for of in of_strong if of["unseen"]]
    errors_of = ("before", "after", "refitted", "truth")
    of_kind: Callable[[str], list[str]] = lambda kind: [median(u[error] for k, u in unseen if k == kind) for error in errors_of]
    table(["", "before", "after", "true terms", "true model"], ([kind, *of_kind(kind)] for kind in kinds))

    if outside:
        print("Effects that the analysis was not made for\n")
        rows = []
        for kind in in_order(of["outside"]["kind"] for of in outside):
            own = [of for of in outside if of["outside"]["kind"] == kind]
            told = [(of["outside"]["unexplained"], of["outside"]["named"]) for of in own]
            wrong = counted(alarm.partition(": ")[2] or alarm for of in own for alarm in of["false_alarms"])
            counts = [sum(one for one, _ in told), sum(one for _, one in told), sum(map(any, told))]
            rows.append([kind, len(own), *counts, sum(not of["false_alarms"] for of in own), wrong])
        table(["", "number", "unexplained", "right name", "either", "no wrong name", "wrong names"], rows)

    def is_wrong(group: str) -> list[bool]:
        return [bool(of["false_alarms"]) for own, of in groups if own == group]

    def all_named(group: str) -> list[bool]:
        return [all(answer["named"] for answer in of["answers"]) for own, of in groups if own == group]

    def within(error: str, of: str) -> list[bool]:
        return [u[error] <= TOLERANCE * u[of] for _, u in unseen]

    told_outside = (of["outside"] for of in outside if of["outside"]["strength"] >= STRONG)
    summary({
        "named: single effects of twice the limit or more": (answer["named"] for answer in strong),
        "an effect reported although nothing was hidden": is_wrong("nothing"),
        "another effect reported although one was hidden": is_wrong("single"),
        "both effects of a pair named": all_named("pair"),
        "all three effects of a triple named": all_named("triple"),
        "wrong names, over all recordings": (bool(of["false_alarms"]) for of in records),
        "effects outside the vocabulary unexplained or rightly named": (of["unexplained"] or of["named"] for of in told_outside),
        "parameters within 10 % (frequencies 2 %)": map(is_near, estimates),
        "95 % intervals that contain the true value": (is_covered(e) for of in singles for e in of["estimates"]),
        "error on unseen data within 1.5 times the true model's": within("after", "truth"),
        "… within 1.5 times that of the fitted true terms": within("after", "refitted"),
        "fitted true terms within 1.5 times the true model": within("refitted", "truth"),
    })
    alarms = Counter(alarm for group, of in groups if group == "nothing" for alarm in of["false_alarms"])
    for alarm, count in sorted(alarms.items()):
        print(f"  false alarm, nothing hidden: {alarm} × {count}")


def measured(result: dict[str, Any]) -> None:
    scores = result["scores"]
    for score in scores:
        ((score["class"], score["kind"]),) = score["kind"].items()

    def grew(score: dict[str, Any]) -> bool:
        errors = score["errors"]
        after, before = errors["after"], errors["before"]
        return after is not None and before is not None and after > max(FAILS, before)

    def row(name: str, own: list[dict[str, Any]]) -> list[object]:
        estimates = [estimate for score in own for estimate in score["estimates"]]
        shares = [(score["named"] for score in own), (bool(score["wrong_names"]) for score in own), map(grew, own)]
        cases = [cell(of) for of in (*shares, map(is_near, estimates), map(is_covered, estimates))]
        return [name, *cases, *(median(score["errors"][of] for score in own) for of in ("before", "after", "untouched_after"))]

    print("Effects in measured noise; deviance per point on the unseen half: medians\n")
    for key in ("kind", "recording"):
        names = in_order(score[key] for score in scores)
        rows = [row(name, [score for score in scores if score[key] == name]) for name in names]
        table(["", "named", "wrong", "grew", "near", "held", "before", "after", "untouched"], rows)
    summary({
        "named: effects that the report has a name for": (score["named"] for score in scores if score["class"] == "known"),
        "unexplained or rightly named: the others": (score["named"] for score in scores if score["class"] == "outside"),
        "a wrong name beyond those of the untouched stretch": (bool(score["wrong_names"]) for score in scores),
        "error on the unseen half above both 3 and N, B and K": map(grew, scores),
    })
    for kind, stretches in Counter(kind for of in result["not_hidden"] for kind in of.values()).items():
        print(f"  not hidden, as no channel can have it at this strength: {kind}, in {stretches} stretches")
    for title, key, is_of in (("wrong", "wrong_names", bool), ("missed", "found", None)):
        for score in scores:
            if is_of(score[key]) if is_of else not score["named"]:
                where = f"{', '.join(score['channels'])} of {score['recording']} from {score['from_s']:.0f} s"
                names = ", ".join(score[key]) or "nothing"
                print(f"  {title}: {score['kind']} of strength {score['strength']:.1f} in {where}: {names}")


def contradictions(result: dict[str, Any]) -> None:
    records = [of["sentences"] for of in result["records"]]
    print(f'Sentences under "Contradicted", nothing hidden, {len(records)} records\n')

    def row(title: str, part: str) -> list[object]:
        counts = [sum(part in sentence for sentence in sentences) for sentences in records]
        return [title, *percent(count > 0 for count in counts).split("   "), sum(counts)]

    table(["", "", "records", "sentences"], [*(row(title, part) for part, title in SENTENCES.items()), row("any", "")])
    for sentence in (sentence for sentences in records for sentence in sentences):
        if not any(part in sentence for part in SENTENCES):
            print(f"  not in the table: {sentence}")


def filters(result: dict[str, Any]) -> None:
    print("Noise behind the part's filter: bias with its standard error, 95 % intervals that hold the truth, channels in which")
    print("something is named\n")
    rows = []
    for of in result["cells"]:
        channels = of["channels"]
        row: list[object] = [f"{of['taps']} taps, read every {of['every']}"]
        row.append(cell(bool(c["filter"]) and c["filter"][0] == of["taps"] for c in channels))
        for at in range(3):
            found = [channel["coefficients"][at] for channel in channels if channel["coefficients"][at]]
            errors = [100 * (c["value"] / c["truth"] - 1) for c in found if c["value"] > 0]
            mean = sum(errors) / max(len(errors), 1)
            scatter = sum((error - mean) ** 2 for error in errors)
            bias = f"{mean:+.2f} ± {(scatter / (len(errors) - 1) / len(errors)) ** 0.5:.2f} %" if len(errors) > 1 else "–"
            row += [bias, cell(map(is_covered, found))]
        named = [channel["named"] for channel in channels]
        rows.append([*row, cell(map(bool, named)), counted(name for names in named for name in names)])
    table(["", "filter", *(of for symbol in "NBK" for of in (f"bias of {symbol}", "held")), "named", "names"], rows)


def losses(result: dict[str, Any]) -> None:
    noises = result["noises"]
    print(f"{len(noises[0]['complete'])} records of {result['samples'] / result['rate_hz'] / 3600:.2f} h at {result['rate_hz']} SPS for each noise\n")
    print("Variance over that of the complete record, minus 1, in %: the octave that is farthest from 0, and its standard error;")
    print("in brackets without the correction; smallest degrees of freedom over the complete ones\n")

    def standard_error(values: list[float]) -> float:
        return stdev(values) / len(values) ** 0.5

    def worst(pairs: list[tuple[Any, Any]], low: float, high: float) -> str:
        octaves = []
        for at, octave in enumerate(pairs[0][0]["octaves"]):
            own = [(a["octaves"][at], b["octaves"][at]) for a, b in pairs if at < min(len(a["octaves"]), len(b["octaves"]))]
            if own and low <= octave["n"] <= high:
                mean = fmean(a["avar"] for a, _ in own)
                changes = [b["avar"] - a["avar"] for a, b in own]
                bias, error = fmean(changes) / mean, standard_error(changes) / mean
                edf = fmean(b["edf"] for _, b in own) / fmean(a["edf"] for a, _ in own)
                octaves.append((bias, error, bias + fmean(b["interpolation"] for _, b in own) / mean, edf))
        if not octaves:
            return ""
        bias, error, uncorrected, _ = max(octaves, key=lambda of: abs(of[0] / (of[1] if math.isinf(high) else 1.0)))
        return f"{100 * bias:+.2f} ± {100 * error:.2f} ({100 * uncorrected:+.2f}) {min(of[3] for of in octaves):.3f}"

    compared = [(of["noise"], loss, list(zip(of["complete"], lossy))) for of in noises for loss, lossy in of["lossy"]]
    rows = []
    for noise, loss, pairs in compared:
        lost = 1 - sum(b["samples"] for _, b in pairs) / sum(a["samples"] for a, _ in pairs)
        same = sum(len(a["octaves"]) == len(b["octaves"]) for a, b in pairs)
        rows.append([noise, loss, f"{100 * lost:.2f}", same, *(worst(pairs, low, high) for _, low, high in SAMPLES)])
    table(["noise", "lost", "%", "same longest τ", *(name for name, _, _ in SAMPLES)], rows)
    print("Fitted coefficients, % of the truth: the change by the losses ± its standard error, scatter and bias of the complete")
    print("records; records of which the 95 % interval holds the truth, with and without losses\n")
    rows = []
    for noise, loss, pairs in compared:
        for at, of in enumerate(pairs[0][0]["coefficients"]):
            own = [(a["coefficients"][at], b["coefficients"][at]) for a, b in pairs]
            values = [a["value"] for a, _ in own]
            changes = [b["value"] - a["value"] for a, b in own]
            hold = [sum(one["low"] <= 1 <= one["high"] for one in column) for column in zip(*own)]
            row = [f"{100 * fmean(changes):+.3f} ± {100 * standard_error(changes):.3f}", f"{100 * stdev(values):.3g}"]
            rows.append([noise, loss, of["symbol"], *row, f"{100 * fmean(values) - 100:+.2f}", hold[1], hold[0]])
    table(["noise", "lost", "", "change", "scatter", "bias", "hold", "complete"], rows)


def paper(result: dict[str, Any]) -> None:
    hours, truth = result["hours"], result["truth"]
    print(f"{len(hours)} simulated hours of gyro z at 204.8 SPS, default filter, ±300 °/s\n")
    print("Bias ± scatter of the coefficients, % of the truth\n")
    rows = []
    for at, symbol in enumerate("NBK"):
        columns = ([of(hour)[at] / truth[at] for hour in hours] for of in (lambda h: h["slopes"][0], lambda h: h["slopes"][1], lambda h: h["fitted"]))
        errors = (f"{100 * fmean(of) - 100:+.1f} ± {100 * stdev(of):.1f}" for of in columns)
        low, high = (result["intervals_s"][at][end] for end in ("start", "end"))
        first = [symbol, f"{truth[at]:.3g}", f"{low} … {high}", f"{100 * result['inherent'][at]:+.1f}"]
        rows.append([*first, *errors, f"{100 * fmean(hour['covered'][at] for hour in hours):.0f} %"])
    table(["", "truth", "interval, s", "true curve", "slopes", "overlapped", "fit", "fit covers"], rows)
    print("True curve: slope method on the true curve, without estimation noise. It attributes the curve to one term, but N, B")
    print("and K add up: their fractions of the variance are below.\n")
    print("Standard deviation of the Allan deviation at an octave, %: predicted, and over the seeds\n")

    def scatter(method: int, at: int) -> float:
        deviations = [hour["deviations"][method][at] for hour in hours]
        return stdev(deviations) / fmean(deviations)

    rows = []
    for at, of in enumerate(result["octaves"]):
        parts = (of["formula"], scatter(0, at), of["confidence"], scatter(1, at))
        rows.append([f"{of['tau_s']:.3g}", *(f"{100 * part:.2f}" for part in parts), *(f"{100 * part:.1f}" for part in of["shares"])])
    table(["τ, s", "formula (6)", "not overlapped", "by edf", "overlapped", "N, %", "B, %", "K, %"], rows)
    four_methods(result["four_methods"], result["truth"])


def four_methods(record: dict[str, Any], truth: list[float]) -> None:
    def with_bounds(value: float | None, bounds: list[float] | None) -> str:
        return "–" if value is None else f"{value:.3g}" + (f" ({bounds[0]:.3g}…{bounds[1]:.3g})" if bounds else "")

    print(f"Four methods on one record (seed {record['seed']}): coefficients in °/√s, °/s, °/s^1.5, with 95 % bounds\n")
    rows = [[of["method"], *map(with_bounds, of["values"], of["bounds"])] for of in record["coefficients"]]
    table(["", *"NBK"], [["truth", *(f"{value:.3g}" for value in truth)], *rows])
    found = record["autocorrelation"]
    whole, quarters = (with_bounds(found[key], None) for key in ("decay_s", "decay_in_quarters_s"))
    print(f"Autocorrelation: variance {found['variance']:.3g} (°/s)², white part {found['white_variance']:.3g} (°/s)²; decay to 1/e in")
    print(f"{whole} s of the record, {quarters} s of its quarters: flicker noise and walk have no correlation time\n")
    print("Allan deviation, °/s: measured, and by equation (5) from Welch's spectrum; segments of", end=" ")
    print(f"{record['segment_s']:.3g} s resolve τ up to {record['resolved_s']:.3g} s\n")
    rows = []
    for of in record["spectrum"]:
        ratio, errors = of["by_spectrum"] / of["measured"], (of["measured_error"], of["by_spectrum_error"])
        first = [f"{of[key]:.3g}" for key in ("tau_s", "measured", "by_spectrum")]
        rows.append([*first, f"{ratio:.4f}", *(f"{100 * error:.2f}" for error in errors), "yes" if of["resolved"] else "no"])
    table(["τ, s", "measured", "by (5)", "ratio", "±, %", "± by (5), %", "resolved"], rows)
    print("Kalman innovations on the second half, models fitted to the first half\n")
    rows = []
    for test in record["innovations"]:
        tested = [f"{test['normalised']:.3f}", f"{test['low']:.3f} … {test['high']:.3f}", f"{test['correlation']:.3f}"]
        rows.append([test["model"], *tested, f"{test['whiteness_p']:.1e}"])
    table(["model", "normalised variance", "95 % if true", "correlation", "p (white)"], rows)


BENCHMARKS = {of.__name__: of for of in (undeclared, measured, contradictions, filters, losses, paper)}


def main() -> None:
    if len(sys.argv) > 2 or sys.argv[1:2] in (["-h"], ["--help"]):
        sys.exit(__doc__)
    with open(sys.argv[1] if sys.argv[1:] else 0, encoding="utf-8") as file:
        result = json.load(file)
    BENCHMARKS[result["benchmark"]](result)


if __name__ == "__main__":
    main()

//! What changed with ties, as people read it.

use std::fmt::Write;

use serde_json::Value;

use super::Document;
use super::conclusions::{Changed, Held};
use super::parting::Parting;

/// As many values as are listed with all their seeds; more are told by the least, the middle and the greatest.
const VALUES_SHOWN: usize = 4;

/// Letters of a value that are shown.
const VALUE_CHARS: usize = 60;

/// All of it; `given` is what the command was given to run.
pub(super) fn told(document: &Document<'_>, program: &str, given: &str) -> String {
    let Document {
        scenario,
        seed,
        tie_seeds,
        digests,
        compared,
        changed,
        ..
    } = document;
    let runs = tie_seeds.len();
    let mut text = format!(
        "{scenario}, seed {seed}: {runs} runs, {}\n",
        seeds(tie_seeds)
    );
    let orders = match digests {
        1 => "all of them the same, message by message".to_owned(),
        digests => format!("{digests} different orders of events"),
    };
    let _ = writeln!(text, "{orders}\n");
    if changed.is_empty() {
        let _ = writeln!(text, "none of {compared} conclusions changes");
        return text;
    }
    let _ = writeln!(text, "{} of {compared} conclusions change\n", changed.len());
    let widths = changed.iter().map(|changed| changed.name.chars().count());
    let width = widths.max().unwrap_or(0);
    for changed in *changed {
        for (at, line) in lines(changed).iter().enumerate() {
            let name = if at == 0 { &changed.name } else { "" };
            let _ = writeln!(text, "  {name:width$}  {line}");
        }
    }
    if let Some(parting) = document.parting {
        parted(&mut text, parting);
        let of = parting.tie_seeds.iter().flatten().next_back();
        if let Some(of) = of {
            let _ = writeln!(
                text,
                "\n`{program} run {given} --tie-seed {of} --out other.mcap` logs the other run"
            );
        }
    }
    text
}

/// A value and who has it, in a line each; of many numbers the least, the middle and the greatest.
fn lines(changed: &Changed) -> Vec<String> {
    let line = |held: &Held| {
        let (runs, value) = (held.tie_seeds.len(), value(&held.value));
        let runs = format!("{runs} run{}", if runs == 1 { "" } else { "s" });
        format!("{value}: {runs}, {}", seeds(&held.tie_seeds))
    };
    let all = &changed.values;
    let (Some(least), Some(greatest)) = (all.first(), all.last()) else {
        return Vec::new();
    };
    let is_long = |held: &Held| held.value.is_array() || held.value.is_object();
    if all.len() <= VALUES_SHOWN && !all.iter().any(is_long) {
        return all.iter().map(line).collect();
    }
    let Some(median) = changed.median else {
        let own = &changed.own().tie_seeds;
        let as_it_is = format!("as it is in {}, {}", own.len(), seeds(own));
        return vec![format!("{} different ones; {as_it_is}", all.len())];
    };
    let own = changed.own();
    vec![
        format!(
            "{} to {}, in the middle {}; as it is {}",
            value(&least.value),
            value(&greatest.value),
            number(median),
            value(&own.value)
        ),
        format!("least {}", line(least)),
        format!("most  {}", line(greatest)),
    ]
}

fn value(value: &Value) -> String {
    let text = match value {
        Value::Null => "missing".to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(figure) => match figure.as_f64() {
            Some(figure) => number(figure),
            None => figure.to_string(),
        },
        other => other.to_string(),
    };
    match text.char_indices().nth(VALUE_CHARS) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text,
    }
}

/// Whole numbers as they are, others to six digits, very small ones with an exponent.
fn number(figure: f64) -> String {
    let rounded = format!("{figure:.5e}").parse::<f64>().unwrap_or(figure);
    match figure.abs() {
        size if figure.fract() == 0.0 && size < 1e15 => figure.to_string(),
        size if (1e-4..1e15).contains(&size) => rounded.to_string(),
        _ => format!("{rounded:e}"),
    }
}

/// Tie seeds in words: `by name`, `tie seeds 1 to 12, 14`.
fn seeds(seeds: &[Option<u64>]) -> String {
    let mut numbers: Vec<u64> = seeds.iter().flatten().copied().collect();
    numbers.sort_unstable();
    let mut spans: Vec<[u64; 2]> = Vec::new();
    for number in &numbers {
        match spans.last_mut() {
            Some([_, last]) if last.checked_add(1) == Some(*number) => *last = *number,
            _ => spans.push([*number, *number]),
        }
    }
    let spans: Vec<String> = spans
        .into_iter()
        .map(|[first, last]| match last - first {
            0 => first.to_string(),
            1 => format!("{first}, {last}"),
            _ => format!("{first} to {last}"),
        })
        .collect();
    let mut parts = Vec::new();
    if seeds.contains(&None) {
        parts.push("by name".to_owned());
    }
    if !spans.is_empty() {
        let what = match numbers.len() {
            1 => "tie seed",
            _ => "tie seeds",
        };
        parts.push(format!("{what} {}", spans.join(", ")));
    }
    parts.join(" and ")
}

/// Where two runs part.
fn parted(text: &mut String, parting: &Parting) {
    let names = parting.tie_seeds.map(|seed| seeds(&[seed]));
    let [a, b] = &names;
    let _ = writeln!(text, "\nwhere the runs {a} | {b} part");
    let time = |ns: u64| format!("{:.6} s", ns as f64 / 1e9);
    if let Some(tie) = &parting.tie {
        let at = time(tie.time_ns);
        let _ = match &tie.at {
            Some(to) => writeln!(text, "  {at}  to {to} this happens in another order:"),
            None => writeln!(
                text,
                "  {at}  the last that is in another order before that:"
            ),
        };
        let (first, then) = (&tie.first, &tie.then);
        let _ = writeln!(text, "    {a}: {first}, then {then}");
        let _ = writeln!(text, "    {b}: {then}, then {first}");
        let _ = writeln!(
            text,
            "    (the last swap before what differs first: the likeliest to decide, which is not proved)"
        );
    }
    if let Some(state) = &parting.state {
        let (at, topic) = (time(state.time_ns), &state.topic);
        let _ = writeln!(text, "  {at}  {topic} is the first state that differs");
    }
    match (&parting.event, &parting.state) {
        (Some(event), _) => {
            let (id, field) = (&event.id, &event.field);
            let _ = writeln!(
                text,
                "  {}  {id} is the first that differs, in {field}: {} | {}",
                time(event.time_ns),
                event.a,
                event.b
            );
        }
        (None, Some(_)) => {}
        (None, None) => {
            let _ = writeln!(text, "  nothing differs but the order of events");
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn tie_seeds_that_follow_each_other_are_a_span() {
        let all = |seeds: &[u64]| -> Vec<Option<u64>> { seeds.iter().copied().map(Some).collect() };
        assert_eq!(seeds(&[None]), "by name");
        assert_eq!(seeds(&all(&[7])), "tie seed 7");
        assert_eq!(
            seeds(&all(&[1, 2, 4, 5, 6, u64::MAX])),
            format!("tie seeds 1, 2, 4 to 6, {}", u64::MAX)
        );
        assert_eq!(seeds(&[None, Some(3)]), "by name and tie seed 3");
    }

    #[test]
    fn values_are_short() {
        assert_eq!(value(&json!(3.0)), "3");
        assert_eq!(value(&json!(1.23456789)), "1.23457");
        assert_eq!(value(&json!(null)), "missing");
        assert_eq!(value(&json!("x".repeat(80))).len(), VALUE_CHARS + 3);
        assert_eq!(value(&json!(-0.000123456789)), "-0.000123457");
        assert_eq!(value(&json!(1.5e-7)), "1.5e-7");
    }
}

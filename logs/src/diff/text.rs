//! A comparison as people read it: the first difference and its causes, then how far it spread.

mod reach;

use std::fmt;
use std::path::Path;

use super::{Cause, DiffReport, FirstDifference, TopicDiff};
use crate::group;
use crate::shown::{Seconds, Shown};

/// Rows of the table that people are shown, unless they ask for all.
const ROWS_SHOWN: usize = 15;

/// Causes that people are shown.
const CAUSES_SHOWN: usize = 12;

/// The alternate form, `{:#}`, lists every topic; else topics of numbered actors share a row.
impl fmt::Display for DiffReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for note in &self.notes {
            writeln!(f, "note: {}", Shown(note))?;
        }
        for beside in &self.beside {
            writeln!(f, "{}", Shown(beside))?;
        }
        let Some(first) = &self.first else {
            let word = match self.identical {
                true => "identical",
                false => "not identical, but the messages are the same",
            };
            writeln!(f, "{word}: {}", self.compared())?;
            return self.write_not_compared(f);
        };
        let names = short(Path::new(&self.file_a), Path::new(&self.file_b));
        if let Some(root) = &self.root {
            reach::write_root(f, root, &self.inputs)?;
        }
        write!(f, "first difference at ")?;
        write_first(f, first, &names)?;
        write_causes(f, first)?;
        if let Some(consequence) = &self.consequence {
            write!(f, "its first consequence at ")?;
            write_first(f, consequence, &names)?;
            write_causes(f, consequence)?;
        }
        reach::write(f, &self.spread, self.root.as_ref())?;
        self.write_table(f)?;
        self.write_behaviour(f)?;
        self.write_not_compared(f)
    }
}

impl DiffReport {
    /// What was compared, in words.
    fn compared(&self) -> String {
        let messages = match self.records_a {
            0 => "no messages to compare".to_owned(),
            n => format!("{n} records compared"),
        };
        let others = [
            (self.metadata, "metadata records"),
            (self.attachments, "attachments"),
        ];
        let others = others.into_iter().filter(|(n, _)| *n > 0);
        others.fold(messages, |text, (n, what)| format!("{text}, {n} {what}"))
    }

    fn write_not_compared(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (what, [a, b]) in &self.not_compared {
            let what = match what.as_str() {
                "state" => "state samples",
                "viewer" => "messages for viewers",
                "checkpoint" => "checkpoints",
                "ignored" => "messages on topics that are left out",
                _ => "messages of a kind that is not known",
            };
            writeln!(f, "not compared: {what} ({a} | {b})")?;
        }
        Ok(())
    }
}

/// The name of each file; their whole paths where the names are the same.
pub(super) fn short<'a>(a: &'a Path, b: &'a Path) -> (String, String) {
    let name = |path: &'a Path| path.file_name().map(Path::new).unwrap_or(path);
    let (one, other) = match (name(a), name(b)) {
        (one, other) if one == other => (a, b),
        names => names,
    };
    (one.display().to_string(), other.display().to_string())
}

impl DiffReport {
    fn write_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (a, b) = short(Path::new(&self.file_a), Path::new(&self.file_b));
        writeln!(
            f,
            "\n{} records in {a}, {} in {b}; of these are",
            self.records_a, self.records_b
        )?;
        writeln!(
            f,
            "  ~ changed   < only in {a}   > only in {b}   ^ reordered\n"
        )?;
        writeln!(f, "{:>8} {:>8} {:>8} {:>8}", "~", "<", ">", "^")?;
        let all = f.alternate();
        let groups = group::groups(&self.topics, all, |topic| &topic.topic);
        let mut rows: Vec<(TopicDiff, usize)> = groups
            .into_iter()
            .map(|(name, topics)| (TopicDiff::sum(name, &topics), topics.len()))
            .collect();
        rows.sort_by_key(|(row, _)| std::cmp::Reverse(row.differences()));
        let shown = if all { rows.len() } else { ROWS_SHOWN };
        let grouped = rows.iter().any(|(_, topics)| *topics > 1);
        for (row, topics) in rows.iter().take(shown) {
            write_row(f, row, *topics)?;
        }
        let total = TopicDiff {
            topic: "in all".to_owned(),
            changed: self.changed,
            only_in_a: self.only_in_a,
            only_in_b: self.only_in_b,
            reordered: self.reordered,
            ..TopicDiff::default()
        };
        match (rows.len().saturating_sub(shown), grouped) {
            (0, false) => {}
            (0, true) => writeln!(f, "{:37}(--topics lists every topic)", "")?,
            (more, _) => writeln!(f, "{:37}and {more} more (--topics lists all)", "")?,
        }
        write_row(f, &total, 1)
    }
}

/// Topics whose behaviour people are shown, and fields of each.
const BEHAVIOUR_SHOWN: usize = 5;
const FIELDS_SHOWN: usize = 3;

impl DiffReport {
    /// How often there are messages, how long there is none, and what changed by how much.
    fn write_behaviour(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (topics, fields) = match f.alternate() {
            true => (usize::MAX, usize::MAX),
            false => (BEHAVIOUR_SHOWN, FIELDS_SHOWN),
        };
        if self.topics.is_empty() {
            return Ok(());
        }
        let (a, b) = short(Path::new(&self.file_a), Path::new(&self.file_b));
        writeln!(f, "\nhow they behave, {a} | {b}\n")?;
        let [messages, rate, gap] = ["messages", "rate, 1/s", "largest gap, s"];
        writeln!(f, "{messages:>17} {rate:>19} {gap:>19}")?;
        for topic in self.topics.iter().take(topics) {
            let (x, y) = (&topic.rate_a, &topic.rate_b);
            let counts = (topic.a, topic.b);
            let rates = (Figure(x.rate_hz), Figure(y.rate_hz));
            let gaps = (Figure(x.largest_gap_s), Figure(y.largest_gap_s));
            let counts = format!("{} | {}", counts.0, counts.1);
            let rates = format!("{} | {}", rates.0, rates.1);
            let gaps = format!("{} | {}", gaps.0, gaps.1);
            writeln!(
                f,
                "{counts:>17} {rates:>19} {gaps:>19}  {}",
                Shown(&topic.topic)
            )?;
            for field in topic.fields.iter().take(fields) {
                write!(
                    f,
                    "{:>21}{}: {} changed",
                    "",
                    Shown(&field.field),
                    field.changed
                )?;
                match (field.mean, field.most) {
                    (Some(mean), Some(most)) => {
                        let (mean, most) = (Figure(mean), Figure(most));
                        writeln!(f, ", by {mean} on average, {most} at most")?;
                    }
                    _ => writeln!(f)?,
                }
            }
            let more = topic.fields.len().saturating_sub(fields);
            if more > 0 {
                writeln!(f, "{:>21}and {more} fields more (--topics lists all)", "")?;
            }
        }
        match self.topics.len().saturating_sub(topics) {
            0 => Ok(()),
            more => writeln!(f, "{:>21}and {more} topics more (--topics lists all)", ""),
        }
    }
}

/// A number with four digits that count.
struct Figure(f64);

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.0.abs();
        let digits = match size {
            _ if size == 0.0 => 0,
            _ if size >= 1000.0 => 0,
            _ if size >= 100.0 => 1,
            _ if size >= 10.0 => 2,
            _ if size >= 1.0 => 3,
            _ if size >= 0.001 => 5,
            _ => return write!(f, "{:.3e}", self.0),
        };
        match size >= 1e9 {
            true => write!(f, "{:.3e}", self.0),
            false => write!(f, "{:.digits$}", self.0),
        }
    }
}

fn write_row(f: &mut fmt::Formatter<'_>, row: &TopicDiff, topics: usize) -> fmt::Result {
    let count = |n: u64| match n {
        0 => "-".to_owned(),
        n => n.to_string(),
    };
    write!(
        f,
        "{:>8} {:>8} {:>8} {:>8}  {}",
        count(row.changed),
        count(row.only_in_a),
        count(row.only_in_b),
        count(row.reordered),
        Shown(&row.topic)
    )?;
    if topics > 1 {
        write!(f, "  ({topics} topics)")?;
    }
    match row.first_ns {
        Some(first_ns) => writeln!(f, "  from {} s", Seconds(first_ns)),
        None => writeln!(f),
    }
}

impl TopicDiff {
    fn sum(name: String, topics: &[&TopicDiff]) -> TopicDiff {
        let mut sum = TopicDiff {
            topic: name,
            ..TopicDiff::default()
        };
        for topic in topics {
            sum.first_ns = [sum.first_ns, topic.first_ns].into_iter().flatten().min();
            sum.a += topic.a;
            sum.b += topic.b;
            sum.changed += topic.changed;
            sum.only_in_a += topic.only_in_a;
            sum.only_in_b += topic.only_in_b;
            sum.reordered += topic.reordered;
        }
        sum
    }
}

fn write_first(
    f: &mut fmt::Formatter<'_>,
    first: &FirstDifference,
    names: &(String, String),
) -> fmt::Result {
    write!(f, "{} s on {}", Seconds(first.time_ns), Shown(&first.topic))?;
    if first.injected {
        // With a class before 1.3's topics as well: `/event/crash/node_07`.
        let class = first.topic.split('/').nth(2).unwrap_or_default();
        let whom = Shown(&first.receiver);
        write!(f, ": {} of {whom}, injected before the run", Shown(class))?;
    } else if !first.sender.is_empty() {
        write!(
            f,
            ": {} to {}, message {}",
            Shown(&first.sender),
            Shown(&first.receiver),
            first.ordinal
        )?;
    }
    if let Some(key) = &first.match_key {
        write!(f, ", key {key}")?;
    }
    let [field, a, b] = [&first.field, &first.a, &first.b].map(|text| Shown(text));
    writeln!(f, "\n  {field}: {a} | {b}")?;
    if !first.link.is_empty() {
        writeln!(f, "  on link {}", Shown(&first.link))?;
    }
    if first.carried_a.is_some() || first.carried_b.is_some() {
        return write_carried(f, first, names);
    }
    if !first.reason.is_empty() {
        writeln!(f, "  lost for {}", Shown(&first.reason))?;
    }
    Ok(())
}

/// How each of the logs has the message.
fn write_carried(
    f: &mut fmt::Formatter<'_>,
    first: &FirstDifference,
    (a, b): &(String, String),
) -> fmt::Result {
    let width = a.chars().count().max(b.chars().count());
    for (name, carried) in [(a, &first.carried_a), (b, &first.carried_b)] {
        let Some(carried) = carried else {
            continue;
        };
        let (sent, at) = (Seconds(carried.sent_ns), Seconds(carried.at_ns));
        let fate = Shown(&carried.fate);
        write!(
            f,
            "  in {:width$}  sent {sent} s, {fate} {at} s",
            Shown(name).to_string()
        )?;
        if !carried.reason.is_empty() {
            write!(f, " for {}", Shown(&carried.reason))?;
        }
        match carried.carriage.as_str() {
            "" => writeln!(f)?,
            carriage => writeln!(f, ": {carriage}")?,
        }
    }
    let ids =
        [&first.carried_a, &first.carried_b].map(|carried| carried.as_ref().map(|one| &one.id));
    match ids {
        [Some(a), Some(b)] if a != b => writeln!(f, "  id  {} | {}", Shown(a), Shown(b)),
        [Some(id), _] | [None, Some(id)] => writeln!(f, "  id  {}", Shown(id)),
        [None, None] => Ok(()),
    }
}

fn write_causes(f: &mut fmt::Formatter<'_>, first: &FirstDifference) -> fmt::Result {
    let count = first.causes.len();
    for (at, cause) in first.causes.iter().enumerate() {
        let last = at + 1 == count;
        if at >= CAUSES_SHOWN && !last {
            continue;
        }
        if last && count > CAUSES_SHOWN {
            let omitted = first.causes_omitted + (count - 1 - CAUSES_SHOWN) as u64;
            writeln!(f, "  ... {omitted} more ...")?;
        }
        let Cause {
            time_ns,
            topic,
            sender,
            receiver,
            ordinal,
            fate,
            repeats,
            since_ns,
            ..
        } = cause;
        let (time, topic) = (Seconds(*time_ns), Shown(topic));
        let who = if sender == receiver {
            sender.clone()
        } else {
            format!("{sender} to {receiver}")
        };
        let who = Shown(&who);
        writeln!(
            f,
            "  because {time} s {fate} {topic} ({who}, number {ordinal})"
        )?;
        if *repeats > 0 {
            let since = Seconds(*since_ns);
            writeln!(f, "    and {repeats} before it in a row, from {since} s on")?;
        }
    }
    Ok(())
}

//! A story in words.

use std::collections::BTreeMap;
use std::fmt;

use farside_actors::system::{Doing, Phase};

use super::story::{Lost, Story, Touching, seconds};

/// A story as it is printed: waits shorter than `least_ns` are folded into what is around them.
pub(super) struct Told<'a> {
    pub(super) story: &'a Story,
    pub(super) least_ns: u64,
}

/// Several phases as one line.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Row {
    pub(super) from_ns: u64,
    pub(super) until_ns: u64,
    pub(super) doing: Doing,
    pub(super) text: String,
}

/// Phases as lines: what is shorter than `least_ns` stands with its neighbours in one.
pub(super) fn rows(phases: &[Phase], least_ns: u64) -> Vec<Row> {
    let mut rows = Vec::new();
    let is_long = |phase: &Phase| {
        let long = phase.until_ns - phase.from_ns >= least_ns;
        matches!(phase.doing, Doing::Down | Doing::Done) || (phase.doing == Doing::Waiting && long)
    };
    for group in phases.chunk_by(|a, b| !is_long(a) && !is_long(b)) {
        let (first, last) = (&group[0], &group[group.len() - 1]);
        let row = |doing, text| Row {
            from_ns: first.from_ns,
            until_ns: last.until_ns,
            doing,
            text,
        };
        if group.len() == 1 {
            rows.push(row(first.doing, first.text.clone()));
            continue;
        }
        let waits = group.iter().filter(|phase| phase.doing == Doing::Waiting);
        let (count, waited_ns) = waits.fold((0, 0), |(count, sum), phase| {
            (count + 1, sum + phase.until_ns - phase.from_ns)
        });
        let active = group.iter().filter(|phase| phase.doing == Doing::Active);
        let mut active = active;
        let ends = (active.clone().next(), active.next_back());
        let what = match ends {
            (Some(first), Some(last)) if first.text == last.text => first.text.clone(),
            (Some(first), Some(last)) => format!("{} … {}", first.text, last.text),
            _ => first.text.clone(),
        };
        let waits = if count == 1 { "wait" } else { "waits" };
        let text = format!(
            "{what}; {count} short {waits}, {} in all",
            seconds(waited_ns)
        );
        rows.push(row(Doing::Active, text));
    }
    rows
}

/// Lost messages in a line: how many of what by whom.
pub(super) fn losses(losses: &[Lost], is_for_it: bool) -> Option<String> {
    let mut groups: BTreeMap<[&str; 4], (u64, u64, u64)> = BTreeMap::new();
    for lost in losses.iter().filter(|lost| lost.is_for_it == is_for_it) {
        let key = [&lost.id.kind, &lost.peer, &lost.link, &lost.reason].map(String::as_str);
        let group = groups.entry(key).or_insert((0, lost.at_ns, lost.at_ns));
        (group.0, group.2) = (group.0 + 1, lost.at_ns);
    }
    if groups.is_empty() {
        return None;
    }
    const SHOWN: usize = 4;
    let mut groups: Vec<_> = groups.into_iter().collect();
    groups.sort_by_key(|(_, (count, ..))| std::cmp::Reverse(*count));
    let more: u64 = groups
        .iter()
        .skip(SHOWN)
        .map(|(_, (count, ..))| count)
        .sum();
    let way = if is_for_it { "from" } else { "to" };
    let group =
        |([kind, peer, link, reason], (count, first, last)): &([&str; 4], (u64, u64, u64))| {
            let when = match first == last {
                true => format!("at {}", seconds(*first)),
                false => format!("{} to {}", seconds(*first), seconds(*last)),
            };
            format!("{count} {kind} {way} {peer} ({link}: {reason}, {when})")
        };
    let mut parts: Vec<String> = groups.iter().take(SHOWN).map(group).collect();
    if more > 0 {
        parts.push(format!("{more} others"));
    }
    let what = if is_for_it {
        "lost on the way to it"
    } else {
        "lost of what it sent"
    };
    Some(format!("{what}: {}", parts.join(", ")))
}

fn span(from_ns: u64, until_ns: Option<u64>) -> String {
    match until_ns {
        Some(until_ns) => format!("{} to {}", seconds(from_ns), seconds(until_ns)),
        None => format!("{} on", seconds(from_ns)),
    }
}

impl fmt::Display for Told<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let story = self.story;
        let until = seconds(story.until_ns);
        writeln!(f, "{} up to {until}: {}", story.actor, story.outcome())?;
        if !story.end.is_empty() {
            writeln!(f, "the run ended: {}", story.end)?;
        }
        if !story.is_told_by_system {
            writeln!(f, "its system tells no more of it than when it was up")?;
        }
        writeln!(f)?;
        for row in rows(&story.account.phases, self.least_ns) {
            let (from, until) = (seconds(row.from_ns), seconds(row.until_ns));
            writeln!(
                f,
                "{from:>12} {until:>12}  {:7}  {}",
                row.doing.name(),
                row.text
            )?;
            let lost = story.lost_within(row.from_ns, row.until_ns);
            for text in [true, false]
                .into_iter()
                .filter_map(|way| losses(lost, way))
            {
                writeln!(f, "{:35} {text}", "")?;
            }
        }
        writeln!(f)?;
        if let Some([from_ns, to_ns]) = story.silence_ns {
            let span = span(from_ns, Some(to_ns));
            let length = seconds(to_ns - from_ns);
            writeln!(f, "longest silence on its links: {length}, {span}")?;
        }
        for (kind, touching) in [("degrade", &story.degrades), ("crash", &story.crashes)] {
            for Touching {
                entry,
                from_ns,
                until_ns,
                text,
            } in touching
            {
                let span = span(*from_ns, *until_ns);
                writeln!(f, "[[{kind}]] {}: {text}, {span}", entry + 1)?;
            }
        }
        for remark in &story.remarks {
            writeln!(f, "{remark}")?;
        }
        Ok(())
    }
}

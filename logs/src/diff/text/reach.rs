//! What the differences began with, whom they reached, and how, as people read it.

use std::fmt;

use crate::diff::{Hop, Reached, Root, RootKind};
use crate::shown::{Seconds, Shown};

/// Actors that people are shown, unless they ask for all.
const ACTORS_SHOWN: usize = 6;

/// Inputs that people are shown.
const INPUTS_SHOWN: usize = 4;

/// Actors of a way that people are shown.
const BY_SHOWN: usize = 5;

/// Writes in two or three lines what differences began with.
pub(super) fn write_root(
    f: &mut fmt::Formatter<'_>,
    root: &Root,
    inputs: &[String],
) -> fmt::Result {
    let (time, what) = (Seconds(root.time_ns), Shown(&root.what));
    match root.kind {
        RootKind::End => write!(f, "root: {what}")?,
        _ => write!(f, "root: {time} s  {what}")?,
    }
    match root.more {
        0 => writeln!(f)?,
        more => writeln!(
            f,
            ", with {more} more that differ in what is planned for then"
        )?,
    }
    if let Some(draw) = &root.draw {
        writeln!(f, "  draw: {}", Shown(draw))?;
    }
    if inputs.is_empty() && root.kind != RootKind::End {
        let same = "seed, scenario, files and code version";
        writeln!(f, "  though {same} are the same in both")?;
    }
    for (at, input) in inputs.iter().take(INPUTS_SHOWN).enumerate() {
        let word = if at == 0 {
            "the runs differ in"
        } else {
            "and in"
        };
        writeln!(f, "  {word} {}", Shown(input))?;
    }
    match inputs.len().saturating_sub(INPUTS_SHOWN) {
        0 => {}
        more => writeln!(f, "  and in {more} more (--json has all)")?,
    }
    writeln!(f)
}

/// Writes whom differences reached in which order, how, and by way of whom.
pub(super) fn write(
    f: &mut fmt::Formatter<'_>,
    spread: &[Reached],
    root: Option<&Root>,
) -> fmt::Result {
    if spread.is_empty() {
        return Ok(());
    }
    let shown = match f.alternate() {
        true => spread.len(),
        false => ACTORS_SHOWN,
    };
    let count = spread.len();
    match count {
        1 => writeln!(f, "\nit reached 1 actor")?,
        count => writeln!(f, "\nit reached {count} actors, in this order")?,
    }
    let width = spread
        .iter()
        .take(shown)
        .map(|reached| reached.actor.chars().count());
    let width = width.max().unwrap_or(0).min(30);
    for reached in spread.iter().take(shown) {
        let (time, actor) = (Seconds(reached.time_ns), Shown(&reached.actor).to_string());
        write!(f, "  {time} s  {actor:width$}  {}", Shown(&reached.how))?;
        write_way(f, reached, root)?;
        writeln!(f)?;
    }
    match count.saturating_sub(shown) {
        0 => Ok(()),
        more => writeln!(f, "  and {more} more (--topics lists all)"),
    }
}

/// The actors between the root and an actor; without any, its root, unless that is the one of all.
fn write_way(f: &mut fmt::Formatter<'_>, reached: &Reached, root: Option<&Root>) -> fmt::Result {
    let before = match reached.path.split_last() {
        Some((_, before)) if !before.is_empty() => before,
        _ => {
            let is_own = |own: &&Root| {
                let planned = own.kind == RootKind::Event
                    && root.is_some_and(|root| root.time_ns == own.time_ns);
                // What an actor does by itself has been said.
                own.kind != RootKind::Actor && root != Some(own) && !planned
            };
            return match reached.root.as_ref().filter(is_own) {
                Some(own) if own.kind == RootKind::Verdict => {
                    write!(f, "  by link {}", Shown(&own.actor))
                }
                Some(own) => write!(f, "  by {}", Shown(&own.what)),
                None => Ok(()),
            };
        }
    };
    let name = |hop: &Hop| Shown(&hop.actor).to_string();
    let names: Vec<String> = match before.len() + reached.path_omitted {
        all if all > BY_SHOWN => {
            let first = before.iter().take(BY_SHOWN - 2).map(name);
            let more = [format!("... {} more ...", all - BY_SHOWN + 1)];
            first.chain(more).chain(before.last().map(name)).collect()
        }
        _ => before.iter().map(name).collect(),
    };
    write!(f, "  by way of {}", names.join(", "))
}

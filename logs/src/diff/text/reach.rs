//! What the differences began with, whom they reached, and how, as people read it.

use std::fmt;

use crate::diff::{Hop, Reached, Root, RootKind};
use crate::shown::{Seconds, Shown};

/// Actors that people are shown, unless they ask for all.
const ACTORS_SHOWN: usize = 12;

/// Inputs that people are shown.
const INPUTS_SHOWN: usize = 4;

/// Actors of a way that people are shown.
const BY_SHOWN: usize = 5;

/// Writes in two or three lines what differences began with.
pub(super) fn write_root(f: &mut fmt::Formatter<'_>, root: &Root) -> fmt::Result {
    let (time, what) = (Seconds(root.time_ns), Shown(&root.what));
    match root.kind {
        RootKind::End => writeln!(f, "root: {what}")?,
        _ => writeln!(f, "root: {time} s  {what}")?,
    }
    let word = match root.inputs.len() {
        0 if root.kind == RootKind::End => return writeln!(f),
        0 => "nothing: seed, scenario, files and code version are the same".to_owned(),
        _ => {
            let shown = root.inputs.iter().take(INPUTS_SHOWN);
            let shown: Vec<String> = shown.map(|input| Shown(input).to_string()).collect();
            match root.inputs.len().saturating_sub(INPUTS_SHOWN) {
                0 => shown.join("; "),
                more => format!("{}; and {more} more (--json has all)", shown.join("; ")),
            }
        }
    };
    writeln!(f, "  what differs at the start and may be why: {word}")?;
    if let Some(draw) = &root.draw {
        writeln!(f, "  its draw: {}", Shown(draw))?;
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
    let actors = if count == 1 { "actor" } else { "actors" };
    writeln!(f, "\nit reached {count} {actors}, in this order")?;
    let width = spread
        .iter()
        .take(shown)
        .map(|reached| reached.actor.chars().count());
    let width = width.max().unwrap_or(0).min(30);
    for reached in spread.iter().take(shown) {
        let (time, actor) = (Seconds(reached.time_ns), Shown(&reached.actor).to_string());
        write!(f, "  {time} s  {actor:width$}  {}", Shown(&reached.how))?;
        write_way(f, reached)?;
        // Whose way begins elsewhere.
        let own = root.is_some_and(|root| root.what == reached.root);
        if !own && reached.path.len() == 1 && !reached.root.starts_with(reached.actor.as_str()) {
            write!(f, "\n{:16}root: {}", "", Shown(&reached.root))?;
        }
        writeln!(f)?;
    }
    match count.saturating_sub(shown) {
        0 => Ok(()),
        more => writeln!(f, "  and {more} more (--topics lists all)"),
    }
}

/// The actors between the root and an actor.
fn write_way(f: &mut fmt::Formatter<'_>, reached: &Reached) -> fmt::Result {
    let Some((_, before)) = reached
        .path
        .split_last()
        .filter(|(_, before)| !before.is_empty())
    else {
        return Ok(());
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

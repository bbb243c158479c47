//! The number that was drawn where a link lost a message by chance, drawn once more from the seed and the message's
//! identity, with the probability that it was compared with.

use std::path::Path;

use farside::carrier::DrawsOf;
use farside::ruling::{MessageId, MessageNumber};
use farside_actors::link::{Drawn, Transmitted};
use farside_logs::{DiffReport, FoundMessage, Log, RunSummary, find_messages};

use crate::commands::logged::scenario_in;
use crate::registry::Registry;

/// Says of a root that is a loss by chance what was drawn in each run, or why that is not known.
pub(in crate::commands) fn tell(report: &mut DiffReport, paths: [&Path; 2], registry: &Registry) {
    let Some(root) = &report.root else {
        return;
    };
    let (Some(reason), Some(message)) = (root.by_chance.clone(), root.message.clone()) else {
        return;
    };
    let Ok(id) = message.parse::<MessageId>() else {
        return;
    };
    let sides = messages(paths, &id);
    let drawn = [0, 1].map(|side| {
        let (id, found) = sides[side].clone()?;
        drawn(paths[side], registry, &reason, &id, &found)
    });
    let text = told(&reason, &drawn, [&report.file_a, &report.file_b]);
    let is_it = |root: &farside_logs::Root| root.message.as_ref() == Some(&message);
    let reached = report.spread.iter_mut();
    let roots = report.root.iter_mut();
    let roots = roots.chain(reached.filter_map(|reached| reached.root.as_mut()));
    for root in roots.filter(|root| is_it(root)) {
        root.draw = Some(text.clone());
    }
}

/// The message in both logs, by the name that its draws go by.
fn messages(paths: [&Path; 2], id: &MessageId) -> [Result<(MessageId, FoundMessage), String>; 2] {
    let find = |path: &Path, id: &MessageId| {
        let found = find_messages(path, std::slice::from_ref(id));
        let found = found.map_err(|error| error.to_string())?;
        let found = found.into_iter().next();
        let found = found.unwrap_or_else(|| Err(format!("{id}: not found")))?;
        let number = match (found.match_key, found.repeat) {
            (None, _) => MessageNumber::Ordinal(found.ordinal),
            (Some(key), Some(repeat)) => MessageNumber::Key { key, repeat },
            (Some(_), None) => {
                return Err(
                    "its flow is not in the log from a message with another key on".to_owned(),
                );
            }
        };
        let named = MessageId {
            number,
            ..id.clone()
        };
        Ok::<_, String>((named, found))
    };
    // What a flow counts may be another number in the other log; its own key is the same.
    let first = find(paths[0], id);
    let by_key = first.as_ref().map_or(id, |(named, _)| named);
    let second = find(paths[1], by_key);
    match (first, second) {
        (first @ Err(_), Ok((named, found))) => {
            let again = find(paths[0], &named);
            [again.or(first), Ok((named, found))]
        }
        both => both.into(),
    }
}

/// What a run's link drew.
fn drawn(
    path: &Path,
    registry: &Registry,
    reason: &str,
    id: &MessageId,
    found: &FoundMessage,
) -> Result<Drawn, String> {
    let log = Log::open(path).map_err(|error| error.to_string())?;
    let summary = RunSummary {
        scenario: log.scenario_name().to_owned(),
        ..RunSummary::default()
    };
    let scenario = scenario_in(&log, &summary, registry).map_err(|error| error.to_string())?;
    let assembled = scenario.assemble().map_err(|error| error.to_string())?;
    let host = |actor: &str| {
        let host = assembled.sim.host_of_named(actor);
        host.ok_or_else(|| format!("the scenario has no {actor}"))
    };
    let (from, to) = (host(&id.sender)?, host(&id.receiver)?);
    let timeline = scenario
        .link_between(from, to)
        .map_err(|error| error.to_string())?;
    let link = found.link.as_deref().ok_or("no link carried it")?;
    let of = Transmitted {
        draws: DrawsOf {
            seed: log.seed(),
            link,
            message: id,
        },
        sent: found.sent,
        carriage: found.carriage,
        bytes: found.bytes,
    };
    let drawn = timeline.redrawn(reason, &of)?;
    // Of other losses it is not known whether they came before the question.
    let (is_lost, arrived) = (found.reason == reason, found.reason.is_empty());
    match drawn.is_lost() == is_lost || !(is_lost || arrived) {
        true => Ok(drawn),
        false => Err(
            "by its scenario this would not have become of it: an actor has changed the link, or another version \
             draws otherwise"
                .to_owned(),
        ),
    }
}

fn told(reason: &str, drawn: &[Result<Drawn, String>; 2], files: [&str; 2]) -> String {
    let one = |drawn: &Drawn| match drawn.attempt {
        1 => format!("{:.6}", drawn.drew),
        attempt => format!("{:.6} at transmission {attempt}", drawn.drew),
    };
    match drawn {
        [Ok(a), Ok(b)] if (a.drew, a.attempt) == (b.drew, b.attempt) => format!(
            "{} for {reason}: lost below {} in {}, below {} in {}",
            one(a),
            a.lost_below,
            files[0],
            b.lost_below,
            files[1]
        ),
        both => {
            let side = |side: usize| match &both[side] {
                Ok(drawn) => format!("{}, lost below {}", one(drawn), drawn.lost_below),
                Err(why) => format!("not known: {why}"),
            };
            let [a, b] = [0, 1].map(side);
            format!("for {reason} {a} in {}; {b} in {}", files[0], files[1])
        }
    }
}

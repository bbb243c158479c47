//! Why two logs differ: the walk back from a difference to what it began with, and from each actor that was
//! reached the way by which it was.
//!
//! Each actor is reached by one message, the first that reaches it otherwise; who sent that otherwise was
//! reached before. So the ways are a tree, and end where nothing differed before: at something planned, at
//! what a link decided, or at an actor that differs by itself.

use std::collections::{BTreeMap, BTreeSet};

use farside::record::RecordClass;

use super::entry::{Entry, Names};
use super::found::Found;
use super::index::Index;
use super::reach::{Moment, Reach, Touched};
use super::root::Starts;
use super::words::Told;
use super::{Hop, Reached, Root, RootKind};
use crate::LogError;
use crate::envelope::{RecordRef, seconds};
use crate::log::LoggedRecord;

/// Steps of a way that are listed: so many from its start, and so many up to its end.
const HOPS_LISTED: usize = 16;

/// Where the way to an actor comes from.
#[derive(Clone)]
enum Upstream {
    Actor(u32),
    Root(Box<Root>),
}

/// How an actor was first reached.
struct Origin {
    moment: Moment,
    topic: String,
    message: Option<String>,
    how: String,
    /// The links on the way from whom it comes, whose state matters.
    links: Vec<Hop>,
    from: Upstream,
}

/// What the walks need of a comparison.
pub(super) struct Walker<'w, 'i> {
    pub(super) logs: [&'w mut Index<'i>; 2],
    pub(super) names: &'w mut Names,
    pub(super) reach: &'w Reach,
    pub(super) starts: &'w Starts,
    pub(super) files: [&'w str; 2],
    records: BTreeMap<(usize, u32), LoggedRecord>,
    origins: BTreeMap<u32, Origin>,
}

type Both = [Option<LoggedRecord>; 2];

impl<'w, 'i> Walker<'w, 'i> {
    pub(super) fn new(
        logs: [&'w mut Index<'i>; 2],
        names: &'w mut Names,
        reach: &'w Reach,
        starts: &'w Starts,
        files: [&'w str; 2],
    ) -> Self {
        Walker {
            logs,
            names,
            reach,
            starts,
            files,
            records: BTreeMap::new(),
            origins: BTreeMap::new(),
        }
    }

    /// Whom the differences reached, in the order in which they did, and by which ways.
    pub(super) fn reached(&mut self) -> Result<Vec<Reached>, LogError> {
        self.fetch_all()?;
        let actors: Vec<u32> = self.reach.actors.keys().copied().collect();
        for actor in &actors {
            if let Some(origin) = self.origin(*actor)? {
                self.origins.insert(*actor, origin);
            }
        }
        let mut order: Vec<u32> = self.origins.keys().copied().collect();
        let names = &*self.names;
        order.sort_by(|one, other| {
            let moment = |actor: &u32| self.origins[actor].moment;
            let by_name = || names.name(*one).cmp(names.name(*other));
            moment(one).cmp(&moment(other), names).then_with(by_name)
        });
        Ok(order.into_iter().map(|actor| self.told(actor)).collect())
    }

    /// What the first difference began with; none if nothing says.
    pub(super) fn root(&mut self, first: &Found) -> Result<Option<Root>, LogError> {
        if self.reach.is_beyond_end(first) {
            return Ok(Some(self.end(first)));
        }
        let from = match first {
            Found::Changed(entry, _) | Found::OnlyInA(entry) | Found::OnlyInB(entry) => {
                match entry.class {
                    RecordClass::Stop => return Ok(Some(self.stopped(first)?)),
                    RecordClass::HandOver | RecordClass::Sample => None,
                    RecordClass::Timer => Some(Upstream::Actor(entry.said.receiver)),
                    _ => Some(self.input(first)?.1),
                }
            }
            Found::Reordered(..) => None,
        };
        let earliest = || {
            let origins = self.origins.iter();
            let first = origins.min_by(|a, b| a.1.moment.cmp(&b.1.moment, self.names));
            first.map(|(actor, _)| Upstream::Actor(*actor))
        };
        Ok(match from.or_else(earliest) {
            Some(Upstream::Root(root)) => Some(*root),
            Some(Upstream::Actor(actor)) => self.way(actor).1,
            None => None,
        })
    }

    /// Reads what touched the actors, each file from front to back.
    fn fetch_all(&mut self) -> Result<(), LogError> {
        for side in 0..2 {
            let touched = self.reach.actors.values();
            let found = touched.flat_map(|touched| [&touched.input, &touched.output]);
            let entries = found
                .flatten()
                .filter_map(|(_, found)| found.both()[side].copied());
            let mut entries: Vec<Entry> = entries.collect();
            entries.sort_unstable_by_key(|entry| entry.at);
            for entry in entries {
                self.fetch(side, &entry)?;
            }
        }
        Ok(())
    }

    fn fetch(&mut self, side: usize, entry: &Entry) -> Result<Option<LoggedRecord>, LogError> {
        if let Some(known) = self.records.get(&(side, entry.at)) {
            return Ok(Some(known.clone()));
        }
        let scanner = &mut self.logs[side].scanner;
        let message = scanner.message_at(entry.position, entry.channel)?;
        let record = RecordRef::read(message.data);
        let record = record.map(|record| LoggedRecord::bodiless(&record, message.channel));
        if let Some(record) = &record {
            self.records.insert((side, entry.at), record.clone());
        }
        Ok(record)
    }

    fn both(&mut self, found: &Found) -> Result<Both, LogError> {
        let mut both = [None, None];
        for (side, entry) in found.both().into_iter().enumerate() {
            if let Some(entry) = entry {
                both[side] = self.fetch(side, entry)?;
            }
        }
        Ok(both)
    }

    fn tell<'t>(&self, both: &'t Both) -> Told<'t>
    where
        'w: 't,
    {
        Told {
            both: both.each_ref().map(Option::as_ref),
            files: self.files,
        }
    }

    /// How an actor was first reached.
    fn origin(&mut self, actor: u32) -> Result<Option<Origin>, LogError> {
        let reach = self.reach;
        let Some(touched) = reach.actors.get(&actor) else {
            return Ok(None);
        };
        let is_reached = self.is_reached_before(touched)?;
        let (moment, found) = match (&touched.input, &touched.output) {
            (Some(input), Some(_)) if is_reached => input,
            (Some(input), None) => input,
            (_, Some(output)) => output,
            (None, None) => return Ok(None),
        };
        let both = self.both(found)?;
        let is_input = touched.input.is_some() && is_reached;
        let (links, from) = match is_input {
            true => self.input(found)?,
            false => (Vec::new(), self.by_itself(actor, moment, found)?),
        };
        let told = self.tell(&both);
        let topic = both.iter().flatten().next().map(|one| one.topic.clone());
        Ok(Some(Origin {
            moment: *moment,
            topic: topic.unwrap_or_default(),
            message: told.message(),
            how: if is_input {
                told.received()
            } else {
                told.done()
            },
            links,
            from,
        }))
    }

    /// Whether something had reached an actor when it first did something otherwise.
    fn is_reached_before(&mut self, touched: &Touched) -> Result<bool, LogError> {
        let ((input, received), (output, done)) = match (&touched.input, &touched.output) {
            (Some(input), Some(output)) => (input, output),
            (input, _) => return Ok(input.is_some()),
        };
        if input.time_ns != output.time_ns {
            return Ok(input.time_ns < output.time_ns);
        }
        // At one instant: by the event in which it was done.
        let (received, done) = (self.both(received)?, self.both(done)?);
        let inputs = received.iter().flatten();
        let first = inputs
            .filter(|record| !matches!(record.class, RecordClass::Lost | RecordClass::InFlight))
            .map(|record| record.key.to_ref())
            .filter(|key| key.time_ns == input.time_ns)
            .min();
        let acts = done.iter().flatten().map(|record| match &record.cause {
            Some(cause) if record.class.is_fate() => cause.to_ref(),
            _ => record.key.to_ref(),
        });
        let acts = acts.filter(|key| key.time_ns == output.time_ns);
        Ok(match (first, acts.max()) {
            (Some(first), Some(last)) => first <= last,
            _ => true,
        })
    }

    /// Where something that reached an actor otherwise comes from, and links on the way.
    fn input(&mut self, found: &Found) -> Result<(Vec<Hop>, Upstream), LogError> {
        let Some(entry) = found.both().into_iter().flatten().next().copied() else {
            return Ok((Vec::new(), Upstream::Actor(0)));
        };
        if !entry.class.is_fate() {
            let is_planned = self.names.name(entry.source) == "@control";
            let from = match entry.class {
                RecordClass::Change if !is_planned => Upstream::Actor(entry.source),
                _ => Upstream::Root(Box::new(self.event(found)?)),
            };
            return Ok((Vec::new(), from));
        }
        if self.reach.may_have_arrived(found) {
            // Nothing says whether it was sent in the other run; whoever was reached may have sent it otherwise.
            let sender = self.reach.actors.get(&entry.said.sender);
            let first = sender.map(|sender| [&sender.input, &sender.output]);
            let mut first = first.into_iter().flatten().flatten();
            let is_reached = first.any(|(moment, _)| moment.time_ns <= entry.said.sent_ns);
            return match is_reached {
                true => Ok((Vec::new(), Upstream::Actor(entry.said.sender))),
                false => self.verdict(found, &entry),
            };
        }
        match found.is_sent_alike() && !found.is_renumbered() {
            true => self.verdict(found, &entry),
            false => Ok((Vec::new(), Upstream::Actor(entry.said.sender))),
        }
    }

    /// Where it comes from that a link decided otherwise about a message.
    fn verdict(&mut self, found: &Found, entry: &Entry) -> Result<(Vec<Hop>, Upstream), LogError> {
        let both = self.both(found)?;
        let told = self.tell(&both);
        let (by_traffic, root) = (told.is_by_traffic(), self.decided(found, &both));
        let itself = (Vec::new(), Upstream::Root(Box::new(root)));
        if self.starts.rule(both.each_ref().map(Option::as_ref)) {
            return Ok(itself);
        }
        let reach = self.reach;
        let until_ns = found.when(self.names).0;
        let sent_ns = entry.said.sent_ns;
        let link = reach.links.get(&entry.said.link);
        let change = link.and_then(|link| link.input.as_ref());
        let change = change.filter(|(moment, _)| moment.time_ns <= until_ns);
        let traffic = link.and_then(|link| link.output.as_ref());
        let traffic = traffic.filter(|(moment, _)| moment.time_ns <= sent_ns);
        // A queue comes of what was carried before, or of how fast.
        let is_first = |(moment, _): &&(Moment, Found)| {
            traffic.is_none_or(|(other, _)| !by_traffic || moment.time_ns <= other.time_ns)
        };
        if let Some((_, change)) = change.filter(is_first) {
            return self.changed(change, entry);
        }
        if self.starts.may_decide() && !by_traffic {
            return Ok(itself);
        }
        if let Some((_, other)) = traffic {
            let both = self.both(other)?;
            let how = format!("is given {} otherwise", self.tell(&both).name());
            let hop = self.link_hop(entry, other, how);
            let sender = other.both().into_iter().flatten().next();
            let sender = sender.map_or(entry.said.sender, |other| other.said.sender);
            return Ok((vec![hop], Upstream::Actor(sender)));
        }
        // Where its ends are, and what else is on its channel, depends on what reached them.
        let ends = [entry.said.sender, entry.said.receiver];
        let touched = |end: &&u32| {
            let touched = reach.actors.get(*end);
            let first = touched.map(|touched| [&touched.input, &touched.output]);
            let mut first = first.into_iter().flatten().flatten();
            first.any(|(moment, _)| moment.time_ns < until_ns)
        };
        match ends.iter().find(touched) {
            Some(end) if !self.starts.may_decide() => {
                let how = format!("carries for {} otherwise", self.names.name(*end));
                let hop = self.link_hop(entry, found, how);
                Ok((vec![hop], Upstream::Actor(*end)))
            }
            _ => Ok(itself),
        }
    }

    /// Where it comes from that a link was changed otherwise: from a plan, or from an actor.
    fn changed(&mut self, change: &Found, entry: &Entry) -> Result<(Vec<Hop>, Upstream), LogError> {
        let (_, from) = self.input(change)?;
        let hops = match &from {
            Upstream::Actor(actor) => {
                let how = format!("is changed by {} otherwise", self.names.name(*actor));
                vec![self.link_hop(entry, change, how)]
            }
            Upstream::Root(_) => Vec::new(),
        };
        Ok((hops, from))
    }

    fn link_hop(&self, entry: &Entry, found: &Found, how: String) -> Hop {
        let time_ns = found.when(self.names).0;
        Hop {
            time_s: seconds(time_ns),
            time_ns,
            actor: self.names.name(entry.said.link).to_owned(),
            how,
            message: None,
        }
    }

    /// Where it comes from that an actor did something otherwise, before anything reached it otherwise that
    /// the logs have.
    fn by_itself(
        &mut self,
        actor: u32,
        moment: &Moment,
        found: &Found,
    ) -> Result<Upstream, LogError> {
        let both = self.both(found)?;
        if self.starts.has_unseen
            && let Some(sender) = self.unseen_sender(actor, found, &both)?
        {
            return Ok(Upstream::Actor(sender));
        }
        let name = self.names.name(actor).to_owned();
        let what = self.tell(&both).done();
        let before = match self.starts.has_unseen {
            true => "before any difference in what reached it on topics that were compared",
            false => "before any difference in what reached it",
        };
        Ok(Upstream::Root(Box::new(Root {
            what: format!("{name} {what}, {before}"),
            actor: name,
            message: self.tell(&both).message(),
            time_s: seconds(moment.time_ns),
            time_ns: moment.time_ns,
            ..self.new_root(RootKind::Actor, found)
        })))
    }

    /// Who sent the message that made an actor do something, if that message is on a topic that is not compared,
    /// and its sender had been reached.
    fn unseen_sender(
        &mut self,
        actor: u32,
        found: &Found,
        both: &Both,
    ) -> Result<Option<u32>, LogError> {
        for (side, record) in both.iter().enumerate() {
            let Some(cause) = record.as_ref().and_then(|record| record.cause.clone()) else {
                continue;
            };
            let key = cause.to_ref();
            if self.logs[side].event(&key, self.names)?.is_some() {
                continue;
            }
            // The source of a delivery is its link, or within a host its sender.
            let source = self.names.number(&cause.source);
            let reach = self.reach;
            let carried = reach.links.get(&source).and_then(|link| link.output);
            let carried =
                carried.and_then(|(_, found)| found.both().into_iter().flatten().next().copied());
            let sender = carried.map_or(source, |entry| entry.said.sender);
            let when = found.when(self.names).0;
            let touched = reach.actors.get(&sender).is_some_and(|touched| {
                let first = [&touched.input, &touched.output];
                first
                    .into_iter()
                    .flatten()
                    .any(|(moment, _)| moment.time_ns < when)
            });
            if sender != actor && touched {
                return Ok(Some(sender));
            }
        }
        Ok(None)
    }

    fn new_root(&self, kind: RootKind, found: &Found) -> Root {
        let time_ns = found.when(self.names).0;
        Root {
            kind,
            time_s: seconds(time_ns),
            time_ns,
            what: String::new(),
            actor: String::new(),
            message: None,
            draw: None,
            by_chance: None,
            more: 0,
        }
    }

    /// What differs at the starts and may be behind the root of a difference.
    pub(super) fn inputs(&mut self, root: &Root, first: &Found) -> Result<Vec<String>, LogError> {
        if root.kind == RootKind::End && self.reach.ends.iter().any(|end| end.is_cut) {
            return Ok(Vec::new());
        }
        let both = self.both(first)?;
        let both = both.each_ref().map(Option::as_ref);
        Ok(self.starts.fitting(root.kind, first.class(), both))
    }

    /// Something that was planned.
    fn event(&mut self, found: &Found) -> Result<Root, LogError> {
        let both = self.both(found)?;
        let one = both.iter().flatten().next();
        let whom = one.map_or("", |one| one.receiver.as_str());
        let what = one.map_or(String::new(), |one| match one.class {
            RecordClass::Told => format!("{whom} is told {}", one.kind),
            class => format!("{} of {whom}", class.name()),
        });
        let only = match found {
            Found::OnlyInA(_) => format!("in {} only", self.files[0]),
            Found::OnlyInB(_) => format!("in {} only", self.files[1]),
            Found::Changed(..) | Found::Reordered(..) => "differs".to_owned(),
        };
        let root = self.new_root(RootKind::Event, found);
        let more = match self.reach.injected {
            Some((time_ns, count)) if time_ns == root.time_ns => count.saturating_sub(1),
            _ => 0,
        };
        Ok(Root {
            what: format!("{what}, {only}"),
            actor: whom.to_owned(),
            more,
            ..root
        })
    }

    /// What a link decided.
    fn decided(&self, found: &Found, both: &Both) -> Root {
        let told = self.tell(both);
        let one = both.iter().flatten().next();
        let link = one.and_then(|one| one.link.clone());
        let ruled = self.starts.rule(told.both);
        let whose = match &link {
            Some(link) => format!("link {link}"),
            None => "delivery within a host".to_owned(),
        };
        Root {
            what: format!("{whose} on {}: {}", told.name(), told.fates()),
            actor: link.unwrap_or_default(),
            message: told.message(),
            by_chance: told.by_chance().filter(|_| !ruled),
            draw: Some(match ruled {
                true => "none: the scenario rules what becomes of it".to_owned(),
                false => told.draw(),
            }),
            ..self.new_root(RootKind::Verdict, found)
        }
    }

    fn stopped(&mut self, found: &Found) -> Result<Root, LogError> {
        let both = self.both(found)?;
        let note = |side: usize| {
            both[side]
                .as_ref()
                .map_or("goes on", |one| one.note.as_str())
        };
        Ok(Root {
            what: format!("the run stops otherwise: {} | {}", note(0), note(1)),
            ..self.new_root(RootKind::End, found)
        })
    }

    /// One of the logs ends, and the other goes on.
    fn end(&self, found: &Found) -> Root {
        let side = usize::from(matches!(found, Found::OnlyInA(_)));
        let end = self.reach.ends[side];
        let how = match end.is_cut {
            true => "is cut",
            false => "ends",
        };
        let time = crate::shown::Seconds(end.time_ns);
        let (file, other) = (self.files[side], self.files[1 - side]);
        let root = self.new_root(RootKind::End, found);
        Root {
            what: format!("{file} {how} at {time} s; up to there {other} says the same"),
            time_ns: end.time_ns,
            time_s: seconds(end.time_ns),
            ..root
        }
    }

    /// The way to an actor, from its root on, and that.
    fn way(&self, actor: u32) -> (Vec<Hop>, Option<Root>) {
        let (mut hops, mut seen) = (Vec::new(), BTreeSet::new());
        let mut next = actor;
        let root = loop {
            let origin = self.origins.get(&next).filter(|_| seen.insert(next));
            let Some(origin) = origin else {
                break None;
            };
            hops.push(Hop {
                time_s: seconds(origin.moment.time_ns),
                time_ns: origin.moment.time_ns,
                actor: self.names.name(next).to_owned(),
                how: origin.how.clone(),
                message: origin.message.clone(),
            });
            hops.extend(origin.links.iter().rev().cloned());
            match &origin.from {
                Upstream::Actor(actor) => next = *actor,
                Upstream::Root(root) => break Some((**root).clone()),
            }
        };
        hops.reverse();
        (hops, root)
    }

    fn told(&self, actor: u32) -> Reached {
        let (mut path, root) = self.way(actor);
        let origin = &self.origins[&actor];
        let omitted = path.len().saturating_sub(2 * HOPS_LISTED);
        if omitted > 0 {
            path.drain(HOPS_LISTED..HOPS_LISTED + omitted);
        }
        Reached {
            actor: self.names.name(actor).to_owned(),
            time_s: seconds(origin.moment.time_ns),
            time_ns: origin.moment.time_ns,
            topic: origin.topic.clone(),
            how: origin.how.clone(),
            message: origin.message.clone(),
            root,
            path,
            path_omitted: omitted,
        }
    }
}

#[cfg(test)]
mod tests;

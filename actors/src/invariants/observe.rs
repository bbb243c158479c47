//! Observers that keep [`Collisions`] and a [`WaitGraph`] from the state samples of a user's
//! actors.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, PoisonError};

use farside::encoding::Schema;
use farside::ids::EntityId;
use farside::record::{Flow, Observer, ObserverError, Record, RecordClass, Wants};
use farside::{End, Report, RunInfo, SimDuration, SimTime};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::collisions::{Collisions, Place};
use super::waits::{WaitCycle, WaitGraph};

/// What a monitor found, to be read while the run lasts and after it.
#[derive(Debug)]
pub struct Handle<T>(Arc<Mutex<T>>);

impl<T> Clone for Handle<T> {
    fn clone(&self) -> Self {
        Handle(self.0.clone())
    }
}

impl<T> Handle<T> {
    fn new(value: T) -> Self {
        Handle(Arc::new(Mutex::new(value)))
    }

    fn with<R>(&self, work: impl FnOnce(&mut T) -> R) -> R {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// What was found so far.
    pub fn get(&self) -> T
    where
        T: Clone,
    {
        self.with(|found| found.clone())
    }
}

/// Reads the samples of one type, and numbers the actors that record them.
struct Samples<S> {
    /// The name of the samples' type, once the run has begun.
    kind: String,
    run: Option<Arc<RunInfo>>,
    agents: BTreeMap<EntityId, usize>,
    of: PhantomData<fn() -> S>,
}

impl<S: Serialize + DeserializeOwned + 'static> Samples<S> {
    fn new() -> Self {
        Samples {
            kind: String::new(),
            run: None,
            agents: BTreeMap::new(),
            of: PhantomData,
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        let schema = Schema::of::<S>().map_err(|error| ObserverError(error.to_string()))?;
        self.kind = schema.name().to_owned();
        self.run = Some(run.clone());
        Ok(())
    }

    /// Whose sample this is, and what it says, if it is one. Actors that were not seen before get
    /// their numbers from `add`.
    fn read(
        &mut self,
        record: &Record<'_>,
        add: impl FnOnce(&str) -> usize,
    ) -> Result<Option<(usize, String, S)>, ObserverError> {
        let (Some(run), Some(kind)) = (&self.run, record.kind) else {
            return Ok(None);
        };
        if record.class != RecordClass::Sample || kind.name() != self.kind {
            return Ok(None);
        }
        let state = kind.schema().decode(record.body);
        let state = state.map_err(|error| ObserverError(error.to_string()))?;
        let name = run.name(record.sender);
        let agent = *self
            .agents
            .entry(record.sender)
            .or_insert_with(|| add(name));
        Ok(Some((agent, name.to_owned(), state)))
    }
}

/// Finds collisions among the actors that record samples of type `S`, see [`Collisions`].
///
/// It stops nothing: what observes changes nothing, and the run goes on as it would have.
pub struct CollisionMonitor<S, V, R> {
    samples: Samples<S>,
    read: R,
    found: Handle<Collisions<V>>,
}

impl<S, V, R> CollisionMonitor<S, V, R>
where
    S: Serialize + DeserializeOwned + 'static,
    V: Copy + Ord + Send,
    R: FnMut(&str, &S) -> Place<V> + Send,
{
    /// A monitor that asks `read` where an actor is, by its name and its latest sample; and what to
    /// read the result from.
    pub fn new(read: R) -> (Self, Handle<Collisions<V>>) {
        let found = Handle::new(Collisions::new());
        let monitor = CollisionMonitor {
            samples: Samples::new(),
            read,
            found: found.clone(),
        };
        (monitor, found)
    }
}

impl<S, V, R> Observer for CollisionMonitor<S, V, R>
where
    S: Serialize + DeserializeOwned + 'static,
    V: Copy + Ord + Send,
    R: FnMut(&str, &S) -> Place<V> + Send,
{
    fn wants(&self) -> Wants {
        Wants {
            samples: true,
            ..Wants::default()
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.samples.begin(run)
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        let found = &self.found;
        let add = |name: &str| found.with(|collisions| collisions.add(name));
        if let Some((agent, name, state)) = self.samples.read(record, add)? {
            let place = (self.read)(&name, &state);
            found.with(|collisions| collisions.update(record.time(), agent, place));
        }
        Ok(Flow::Continue)
    }
}

/// For what an agent waits.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Waits<V> {
    /// For nobody: it can go on, or does not want to.
    #[default]
    ForNobody,
    /// For whoever claims this vertex, if anybody does.
    ForVertex(V),
    /// For all of these, by their names.
    ForAgents(Vec<String>),
}

/// What a sample says of the agent that recorded it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seen<V> {
    /// Where it is.
    pub place: Place<V>,
    /// For what it waits.
    pub waits: Waits<V>,
    /// It has done what it was to do: that it does not move means nothing.
    pub done: bool,
}

/// Agents that came to a deadlock.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DeadlockReport<V> {
    /// Since when nothing changed.
    pub since: SimTime,
    /// When that was noticed.
    pub noticed: SimTime,
    /// Who waits for each other, the shortest circle first. Empty if nobody moves and nobody waits
    /// in a circle: they wait for something else.
    pub cycles: Vec<WaitCycle<V>>,
    /// How many agents are not done.
    pub left: usize,
}

impl<V: fmt::Display> fmt::Display for DeadlockReport<V> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "deadlock since {}: ", self.since)?;
        match self.cycles.first() {
            Some(cycle) => cycle.fmt(f),
            None => write!(
                f,
                "{} do not move, and not because of each other",
                self.left
            ),
        }
    }
}

/// Finds those who wait for each other in a circle, among the actors that record samples of type
/// `S`, and teams of which nobody moves.
///
/// - **Circle**: each waits for the next, and none of them has moved or waited for anybody else for
///   a window of virtual time. Others may still move: that is a deadlock of a part of the team.
/// - **Nobody moves**: no agent that is not done has changed its place for the window.
///
/// Both are looked for at each record that the run commits. When nothing at all is left to happen,
/// the window is over at once.
pub struct DeadlockMonitor<S, V, R> {
    samples: Samples<S>,
    read: R,
    window: SimDuration,
    stops: bool,
    watch: Watch<V>,
    found: Handle<Vec<DeadlockReport<V>>>,
}

impl<S, V, R> DeadlockMonitor<S, V, R>
where
    S: Serialize + DeserializeOwned + 'static,
    V: Copy + Ord + fmt::Display + Send,
    R: FnMut(&str, &S) -> Seen<V> + Send,
{
    /// A monitor that asks `read` what an actor's latest sample says, by the actor's name; and what
    /// to read the result from. It reports, and leaves the run alone.
    pub fn new(window: SimDuration, read: R) -> (Self, Handle<Vec<DeadlockReport<V>>>) {
        let found = Handle::new(Vec::new());
        let monitor = DeadlockMonitor {
            samples: Samples::new(),
            read,
            window,
            stops: false,
            watch: Watch::default(),
            found: found.clone(),
        };
        (monitor, found)
    }

    /// The same monitor, but the first deadlock ends the run.
    #[must_use]
    pub fn that_stops(mut self) -> Self {
        self.stops = true;
        self
    }

    fn notice(&mut self, now: SimTime, window: SimDuration) -> Flow {
        let Some(found) = self.watch.deadlock(now, window) else {
            return Flow::Continue;
        };
        let reason = found.to_string();
        self.found.with(|all| all.push(found));
        match self.stops {
            true => Flow::Stop(reason),
            false => Flow::Continue,
        }
    }
}

impl<S, V, R> Observer for DeadlockMonitor<S, V, R>
where
    S: Serialize + DeserializeOwned + 'static,
    V: Copy + Ord + fmt::Display + Send,
    R: FnMut(&str, &S) -> Seen<V> + Send,
{
    fn wants(&self) -> Wants {
        Wants {
            samples: true,
            ..Wants::default()
        }
    }

    fn begin(&mut self, run: &Arc<RunInfo>) -> Result<(), ObserverError> {
        self.samples.begin(run)
    }

    fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
        // First what was there before this record, then what it changes.
        let flow = self.notice(record.time(), self.window);
        let watch = &mut self.watch;
        let add = |name: &str| watch.add(name, record.time());
        if let Some((agent, name, state)) = self.samples.read(record, add)? {
            let seen = (self.read)(&name, &state);
            self.watch.update(record.time(), agent, seen);
        }
        Ok(flow)
    }

    fn end(&mut self, report: &Report) -> Result<(), ObserverError> {
        if report.end == End::Completed {
            self.notice(report.end_time, SimDuration::ZERO);
        }
        Ok(())
    }
}

/// What is known of each agent, and since when.
struct Watch<V> {
    agents: Vec<Agent<V>>,
    numbers: BTreeMap<String, usize>,
    collisions: Collisions<V>,
    /// The circles there are, each with the time since when it stands.
    circles: Vec<(Vec<usize>, SimTime)>,
    reported: Vec<Vec<usize>>,
    /// Something has changed since the circles were looked for.
    stale: bool,
    last_move: SimTime,
    /// That nobody moves was reported, and nobody has moved since.
    rests: bool,
}

impl<V> Default for Watch<V> {
    fn default() -> Self {
        Watch {
            agents: Vec::new(),
            numbers: BTreeMap::new(),
            collisions: Collisions::default(),
            circles: Vec::new(),
            reported: Vec::new(),
            stale: false,
            last_move: SimTime::ZERO,
            rests: false,
        }
    }
}

struct Agent<V> {
    waits: Waits<V>,
    done: bool,
    /// When it last moved, or waited for something else.
    changed: SimTime,
}

impl<V: Copy + Ord> Watch<V> {
    fn add(&mut self, name: &str, now: SimTime) -> usize {
        let number = self.collisions.add(name);
        self.numbers.insert(name.to_owned(), number);
        self.agents.push(Agent {
            waits: Waits::ForNobody,
            done: false,
            changed: now,
        });
        number
    }

    fn update(&mut self, now: SimTime, agent: usize, seen: Seen<V>) {
        let known = &mut self.agents[agent];
        let moved = self.collisions.place(agent) != seen.place || known.done != seen.done;
        if moved || known.waits != seen.waits {
            known.changed = now;
            self.stale = true;
        }
        (known.waits, known.done) = (seen.waits, seen.done);
        if moved {
            self.collisions.update(now, agent, seen.place);
            (self.last_move, self.rests) = (now, false);
        }
    }

    fn graph(&self) -> WaitGraph {
        let mut graph = WaitGraph::new(self.agents.len());
        for (number, agent) in self.agents.iter().enumerate().filter(|(_, a)| !a.done) {
            let by_name = |name: &String| self.numbers.get(name).copied();
            let others: Vec<usize> = match &agent.waits {
                Waits::ForNobody => Vec::new(),
                Waits::ForVertex(v) => {
                    let holders = self.collisions.holders(*v).iter().copied();
                    holders.filter(|&holder| holder != number).collect()
                }
                Waits::ForAgents(names) => names.iter().filter_map(by_name).collect(),
            };
            for other in others {
                graph.add(number, other);
            }
        }
        graph
    }

    fn deadlock(&mut self, now: SimTime, window: SimDuration) -> Option<DeadlockReport<V>> {
        let graph = std::mem::take(&mut self.stale).then(|| self.graph());
        if let Some(graph) = graph {
            let since = |circle: &Vec<usize>| circle.iter().map(|&a| self.agents[a].changed).max();
            let dated = |circle: Vec<usize>| (since(&circle).unwrap_or(now), circle);
            let circles = graph.cycles().into_iter().map(dated);
            self.circles = circles.map(|(since, circle)| (circle, since)).collect();
            let circles = &self.circles;
            let stands = |old: &Vec<usize>| circles.iter().any(|(circle, _)| circle == old);
            self.reported.retain(stands);
        }
        let over = |since: SimTime| now.since(since) >= window;
        let is_new = |circle: &Vec<usize>| !self.reported.contains(circle);
        let due = self
            .circles
            .iter()
            .filter(|(circle, since)| over(*since) && is_new(circle));
        let due: Vec<(Vec<usize>, SimTime)> = due.cloned().collect();
        let left = self.agents.iter().filter(|agent| !agent.done).count();
        let nobody = left > 0 && over(self.last_move) && !self.rests;
        if due.is_empty() && !nobody {
            return None;
        }
        let mut since = due.iter().map(|(_, since)| *since).min();
        if nobody {
            self.rests = true;
            since = since.or(Some(self.last_move));
            if due.is_empty() && !self.reported.is_empty() {
                // They stand because of a circle that was reported already.
                return None;
            }
        }
        self.reported
            .extend(due.iter().map(|(circle, _)| circle.clone()));
        let collisions = &self.collisions;
        let named = |circle: &Vec<usize>| {
            let waiter = |&a: &usize| super::Waiter {
                agent: collisions.name(a).to_owned(),
                at: collisions.place(a).vertex(),
            };
            WaitCycle(circle.iter().map(waiter).collect())
        };
        Some(DeadlockReport {
            since: since.unwrap_or(self.last_move),
            noticed: now,
            cycles: due.iter().map(|(circle, _)| named(circle)).collect(),
            left,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(place: Place<u32>, waits: Waits<u32>) -> Seen<u32> {
        Seen {
            place,
            waits,
            done: false,
        }
    }

    fn at(second: u64) -> SimTime {
        SimTime::from_nanos(second * 1_000_000_000)
    }

    const WINDOW: SimDuration = SimDuration::from_secs(5);

    #[test]
    fn a_circle_is_found_while_others_drive_and_told_once() {
        let mut watch = Watch::default();
        let [a, b, c] = ["a", "b", "c"].map(|name| watch.add(name, at(0)));
        watch.update(at(1), a, seen(Place::At(1), Waits::ForVertex(2)));
        watch.update(
            at(2),
            b,
            seen(Place::At(2), Waits::ForAgents(vec!["a".to_owned()])),
        );
        for second in 2..12 {
            watch.update(
                at(second),
                c,
                seen(Place::At(second as u32 + 10), Waits::ForNobody),
            );
            let found = watch.deadlock(at(second), WINDOW);
            assert_eq!(found.is_some(), second == 7, "at {second} s");
            if let Some(found) = found {
                let text = "deadlock since 2s: a at 1 waits for b at 2, which waits for a";
                assert_eq!(found.to_string(), text);
                assert_eq!((found.noticed, found.left), (at(7), 3));
            }
        }
        // It breaks up and forms anew: that is another one.
        watch.update(at(12), b, seen(Place::At(2), Waits::ForNobody));
        assert_eq!(watch.deadlock(at(12), WINDOW), None);
        watch.update(at(13), b, seen(Place::At(2), Waits::ForVertex(1)));
        watch.update(at(17), c, seen(Place::At(9), Waits::ForNobody));
        assert_eq!(watch.deadlock(at(17), WINDOW), None);
        assert_eq!(watch.deadlock(at(18), WINDOW).unwrap().since, at(13));
    }

    #[test]
    fn a_team_that_rests_without_a_circle_is_found_and_those_who_are_done_are_not() {
        let mut watch = Watch::default();
        let (a, b) = (watch.add("a", at(0)), watch.add("b", at(0)));
        watch.update(at(1), a, seen(Place::At(1), Waits::ForVertex(2)));
        let done = Seen {
            done: true,
            ..seen(Place::At(2), Waits::ForVertex(1))
        };
        watch.update(at(3), b, done);
        assert_eq!(watch.deadlock(at(7), WINDOW), None);
        let found = watch.deadlock(at(8), WINDOW).unwrap();
        assert_eq!((found.since, found.left, found.cycles.len()), (at(3), 1, 0));
        assert_eq!(watch.deadlock(at(20), WINDOW), None, "told once");
    }
}

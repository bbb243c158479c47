//! Messages that handlers of an engine have sent within a host, and that are not queued yet.
//!
//! Where everyone talks to everyone, the number of a flow lies anywhere in many megabytes, and so does
//! the end of the bucket in which a message waits: each takes as long to reach as the rest of an event
//! takes. Neither is asked for before the message is delivered. So both are fetched for many messages
//! at once, and looked up when as many more have been sent: then they are there.

use crate::ids::KindIndex;
use crate::key::Bound;
use crate::queue::Entry;
use crate::time::SimTime;

/// What so many need is fetched at once: as many as a processor waits for together.
const AT_ONCE: usize = 16;

/// A message without its number, whose head says who sent it and nothing of its receiver.
pub(crate) struct Unqueued {
    pub(crate) entry: Entry,
    /// The sender's place among the actors of the engine.
    pub(crate) sender: u32,
    /// The number in the receiver's address.
    pub(crate) declared: u32,
    pub(crate) kind: KindIndex,
}

/// Messages that are not queued yet, in the order in which they were sent.
pub(crate) struct Outbox {
    messages: Vec<Unqueued>,
    /// What so many of the first need was fetched.
    fetched: usize,
    /// The least time at which one of them is delivered.
    least: SimTime,
}

impl Default for Outbox {
    fn default() -> Self {
        Outbox {
            messages: Vec::new(),
            fetched: 0,
            least: SimTime::MAX,
        }
    }
}

impl Outbox {
    #[inline(always)]
    pub(crate) fn push(&mut self, message: Unqueued) {
        self.least = self.least.min(message.entry.time());
        self.messages.push(message);
    }

    pub(crate) fn len(&self) -> usize {
        self.messages.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// True once there are as many as are fetched for at once.
    #[inline(always)]
    pub(crate) fn is_full(&self) -> bool {
        self.messages.len() >= self.fetched + AT_ONCE
    }

    /// Until when the queue alone knows what comes next, and at most this.
    #[inline(always)]
    pub(crate) fn before(&self, bound: Bound) -> Bound {
        bound.min(Bound::at(self.least))
    }

    /// For how many of the first messages was fetched.
    pub(crate) fn fetched(&self) -> usize {
        self.fetched
    }

    /// Those for which nothing was fetched.
    pub(crate) fn unfetched(&self) -> &[Unqueued] {
        &self.messages[self.fetched..]
    }

    /// For all messages was fetched what they need.
    pub(crate) fn all_fetched(&mut self) {
        self.fetched = self.messages.len();
    }

    /// Takes so many of the first, to be queued.
    pub(crate) fn take(&mut self, first: usize) -> impl Iterator<Item = Unqueued> {
        self.messages.drain(..first)
    }

    /// Some of the first were taken, and all for which was fetched.
    pub(crate) fn taken(&mut self) {
        self.fetched = 0;
        let times = self.messages.iter().map(|message| message.entry.time());
        self.least = times.min().unwrap_or(SimTime::MAX);
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex, OnceLock};

    use proptest::prelude::*;
    use serde::{Deserialize, Serialize};

    use crate::carrier::NoChange;
    use crate::prelude::*;
    use crate::record::{Flow, Observer, ObserverError, Record};
    use crate::{Carrier, Executor, MatchKey, Parcel, Verdicts};

    /// So many that what waits counts as large.
    const MANY: u32 = 5000;

    #[derive(Serialize, Deserialize)]
    struct Word(u64);

    #[derive(Serialize, Deserialize)]
    struct Echo(u64);

    type Others = Arc<OnceLock<Vec<Address<Talker>>>>;

    /// Answers each word by one more word, in any of all ways.
    struct Talker {
        at: usize,
        hosts: usize,
        others: Others,
    }

    impl Actor for Talker {
        type Accepts = (Word, Echo);

        fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
            for at in 0..4 {
                let delay = SimDuration::from_nanos(1 + ctx.random("start").below(50));
                ctx.timer(delay, Word(at));
            }
            Ok(())
        }
    }

    impl Handler<Word> for Talker {
        fn handle(&mut self, Word(hops): Word, ctx: &mut Context<'_, Self>) -> Outcome {
            let others = self.others.get().expect("set before the run");
            let mut draw = |n| ctx.random("talk").below(n);
            let (way, at, delay) = (draw(6), draw(others.len() as u64), draw(40));
            let (to, word) = (others[at as usize], Word(hops + 1));
            let delay = SimDuration::from_nanos(delay);
            let near = at as usize % self.hosts == self.at % self.hosts;
            match way {
                _ if !near => ctx.send(to, word),
                0 => ctx.send(to, word),
                1 => ctx.send_keyed(to, MatchKey::new(1, hops as u32 / 4), word),
                2 => {
                    let timer = ctx.timer(SimDuration::from_nanos(5), Word(0));
                    assert!(ctx.cancel(timer));
                    ctx.timer(SimDuration::from_nanos(1), word);
                }
                _ => ctx.send_after(to, delay, word),
            }
            if near {
                ctx.send_after(to, delay, Echo(hops));
                ctx.send(to, Echo(hops));
            }
            Ok(())
        }
    }

    impl Handler<Echo> for Talker {
        fn handle(&mut self, _: Echo, _: &mut Context<'_, Self>) -> Outcome {
            Ok(())
        }
    }

    /// Has timers that are never due.
    struct Bystander(u32);

    impl Actor for Bystander {
        type Accepts = (Word,);

        fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
            for _ in 0..self.0 {
                ctx.timer(SimDuration::from_secs(1), Word(0));
            }
            Ok(())
        }
    }

    impl Handler<Word> for Bystander {
        fn handle(&mut self, _: Word, _: &mut Context<'_, Self>) -> Outcome {
            Ok(())
        }
    }

    struct Wire;

    impl Carrier for Wire {
        type Change = NoChange;

        fn min_delay(&self) -> SimDuration {
            SimDuration::from_nanos(10)
        }

        fn carry(&mut self, parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
            let jitter = parcel.random(0, 0, 0).stream().below(20);
            verdicts.deliver(SimDuration::from_nanos(10 + jitter));
        }

        fn change(&mut self, _: NoChange, _: SimTime) {}
    }

    #[derive(Default)]
    struct Lines(Arc<Mutex<Vec<String>>>);

    impl Observer for Lines {
        fn record(&mut self, record: &Record<'_>) -> Result<Flow, ObserverError> {
            let kind = record.kind.map_or("", |kind| kind.name());
            let line = format!(
                "{:?} {} {:?} {} {} {kind} {} {:?} {:?}",
                record.class,
                record.key,
                record.cause,
                record.sender.0,
                record.receiver.0,
                record.ordinal,
                record.match_key,
                record.body,
            );
            self.0.lock().expect("nobody panicked").push(line);
            Ok(Flow::Continue)
        }
    }

    /// All that happened to talkers while so many events of somebody else waited.
    fn talk(seed: u64, hosts: usize, waiting: u32, executor: Executor) -> Vec<String> {
        let lines = Lines::default();
        let told = lines.0.clone();
        let mut sim = Simulation::new(seed);
        let names = ["host_0", "host_1"];
        let homes: Vec<_> = names[..hosts].iter().map(|name| sim.host(name)).collect();
        // The first to start: all that talkers send is sent while its events wait.
        sim.actor(homes[0], "a_bystander", move |_| Bystander(waiting));
        let others = Others::default();
        let mut all = Vec::new();
        for at in 0..12 {
            let (name, known) = (format!("talker_{at:02}"), others.clone());
            all.push(sim.actor(homes[at % hosts], &name, move |_| Talker {
                at,
                hosts,
                others: known.clone(),
            }));
        }
        if hosts == 2 {
            sim.link(homes[0], homes[1], "to", Wire);
            sim.link(homes[1], homes[0], "fro", Wire);
        }
        sim.crash_at(SimTime::from_nanos(300), all[3]);
        sim.restart_at(SimTime::from_nanos(400), all[3]);
        assert!(others.set(all).is_ok(), "set once");
        sim.observe(lines);
        sim.stop_at(SimTime::from_nanos(600), "enough");
        let report = sim.run(executor).expect("it can start");
        assert_eq!(report.end.name(), "stopped", "{:?}", report.end);
        std::mem::take(&mut told.lock().expect("nobody panicked"))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        /// That messages are numbered and queued later changes nothing of what happens.
        #[test]
        fn nobody_notices_that_very_much_waits(seed in any::<u64>(), hosts in 1_usize..=2) {
            let alone = talk(seed, hosts, 0, Executor::Inline);
            prop_assert!(alone.len() > 500, "{}", alone.len());
            prop_assert_eq!(&alone, &talk(seed, hosts, MANY, Executor::Inline));
            let executor = Executor::Kameo { threads: 2 };
            prop_assert_eq!(&alone, &talk(seed, hosts, MANY, executor));
        }
    }
}

//! Seats: the engines of a run, where whoever has time for one can take it.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
// Real time decides here who runs an engine, and nothing of what the engine does.
#[expect(clippy::disallowed_types)]
use std::time::{Duration, Instant};

use crate::commit::Batch;
use crate::engine::{Action, Engine, Outgoing};
use crate::fault::Fault;
use crate::ids::EntityId;
use crate::key::{Bound, EventKey};

/// An engine, what other engines sent to it, and what it did in the window that just ended.
pub(super) struct Seat {
    pub(super) engine: Engine,
    pub(super) inbox: Vec<Outgoing>,
    pub(super) batch: Batch,
    pub(super) fault: Option<Box<Fault>>,
    pub(super) stops: Vec<(EventKey, EntityId, String)>,
    /// How long it takes for a window or a part of one, as the last few have shown.
    pub(super) expected: Duration,
}

impl Seat {
    fn new(engine: Engine, interrupt: Arc<AtomicBool>) -> Self {
        Seat {
            engine,
            inbox: Vec::new(),
            batch: Batch::new(interrupt),
            fault: None,
            stops: Vec::new(),
            expected: Duration::ZERO,
        }
    }

    /// Time and step of the first event it would handle; none after a fault.
    pub(super) fn peek(&mut self) -> Option<Bound> {
        if self.fault.is_some() {
            return None;
        }
        let arriving = self.inbox.iter().map(|event| Bound {
            time: event.key.time,
            step: event.key.step,
        });
        arriving.chain(self.engine.peek()).min()
    }

    /// Goes on until `bound`, or until it is as far ahead of what is committed as it may be.
    #[expect(clippy::disallowed_types)]
    fn run(&mut self, bound: Bound) {
        if self.fault.is_some() {
            return;
        }
        let begin = Instant::now();
        self.batch.open();
        for Outgoing { key, pending, .. } in self.inbox.drain(..) {
            self.engine.parts.insert_pending(key, pending);
        }
        let result = loop {
            let result = self.engine.run(bound, &mut self.batch);
            // A request to stop interrupts the engine, but takes effect in a later window.
            match self.engine.parts.stop.take() {
                Some(stop) if result.is_ok() => self.stops.push(stop),
                _ => break result,
            }
        };
        self.fault = result.err();
        // Windows in which much is done and windows in which little is often take turns.
        self.expected = (3 * self.expected + begin.elapsed()) / 4;
    }

    /// Applies a control event.
    pub(super) fn control(&mut self, key: EventKey, entity: EntityId, action: Action) {
        let result = self.engine.control(key, entity, action, &mut self.batch);
        self.fault = result.err();
        self.stops.extend(self.engine.parts.stop.take());
    }
}

/// All seats of a run. Nobody waits for a lock: in a window each seat has one claimant, and the
/// coordinator touches them only between windows.
#[derive(Clone)]
pub(super) struct Seats(Arc<[Mutex<Seat>]>);

impl Seats {
    pub(super) fn new(engines: Vec<Engine>, interrupt: &Arc<AtomicBool>) -> Self {
        let seats = engines
            .into_iter()
            .map(|engine| Mutex::new(Seat::new(engine, interrupt.clone())));
        Seats(seats.collect())
    }

    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    pub(super) fn take(&self, at: usize) -> MutexGuard<'_, Seat> {
        // Handlers' panics are caught in the engine and are values there.
        self.0[at].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Hands what the engine at `at` sent to other engines over to them, and notes in `next` when
    /// they and it have something to do.
    pub(super) fn hand_out(&self, at: usize, next: &mut [Option<Bound>]) {
        let mut outgoing = std::mem::take(&mut self.take(at).engine.parts.outgoing);
        for event in outgoing.drain(..) {
            let (time, step) = (event.key.time, event.key.step);
            let (to, arrival) = (event.engine as usize, Bound { time, step });
            next[to] = Some(next[to].map_or(arrival, |known| known.min(arrival)));
            self.take(to).inbox.push(event);
        }
        let mut seat = self.take(at);
        seat.engine.parts.outgoing = outgoing;
        next[at] = seat.peek();
    }
}

/// Waits awake, but not long: to fall asleep and be woken takes about as long as a light handler.
#[expect(clippy::disallowed_types)]
fn wait_awake(is_over: impl Fn() -> bool) {
    const AWAKE: Duration = Duration::from_micros(50);
    let begin = Instant::now();
    while !is_over() && begin.elapsed() < AWAKE {
        std::hint::spin_loop();
    }
}

/// The engines that have something to do in one part of a window. Whoever has time claims the next one.
pub(super) struct Round {
    seats: Seats,
    pub(super) due: Vec<usize>,
    claimed: AtomicUsize,
    done: AtomicUsize,
    bound: Bound,
    /// How many rounds were shared among threads, this one with them.
    number: usize,
    /// The same, as it is now.
    newest: Arc<AtomicUsize>,
}

impl Round {
    pub(super) fn new(
        seats: Seats,
        due: Vec<usize>,
        bound: Bound,
        newest: Arc<AtomicUsize>,
    ) -> Self {
        Round {
            number: newest.load(Ordering::Relaxed),
            newest,
            seats,
            due,
            claimed: AtomicUsize::new(0),
            done: AtomicUsize::new(0),
            bound,
        }
    }

    /// Claims engines and runs them until none is left.
    pub(super) fn share(&self) {
        while let Some(at) = self.due.get(self.claimed.fetch_add(1, Ordering::Relaxed)) {
            self.seats.take(*at).run(self.bound);
            self.done.fetch_add(1, Ordering::Release);
        }
    }

    /// Waits until all engines have run.
    pub(super) fn await_others(&self) {
        wait_awake(|| self.done.load(Ordering::Acquire) >= self.due.len());
    }

    /// Waits until the next round is shared.
    pub(super) fn await_next(&self) {
        wait_awake(|| self.newest.load(Ordering::Relaxed) != self.number);
    }
}

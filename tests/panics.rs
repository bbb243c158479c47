//! Panics of users' code, wherever the kernel calls it or drops what it made, are faults with a name
//! and a readable log, the same on every executor.

use farside::prelude::*;
use farside::record::{Flow, Observer, ObserverError, Record, Wants};
use farside::{Carrier, LinkId, Parcel, Verdicts};
use farside::{End, Fault, FaultCause};
use farside_logs::{LogOptions, LogWriter, info};
use farside_tests::executors::agreed;
use serde::{Deserialize, Serialize, Serializer};

/// What blows up in a run, and when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fuse {
    Constructor,
    ConstructorAtRestart,
    StateAtCrash,
    StateAtRestart,
    StateAtTheEnd,
    DurableAtTheEnd,
    ConstructorsOwnAtTheEnd,
    LinkAtTheEnd,
    ChangeOfLink,
    ChangeByActor,
    OwnLink,
    SharedLink,
    MessageToTheCrashed,
    TimerOfTheCrashed,
    CancelledTimer,
    MessageLostLate,
    MessageInFlight,
    ToldToTheCrashed,
    ToldTooLate,
    Encoding,
    EncodingAndDrop,
    EncodingInFlight,
    EncodingOfTold,
    EncodingOfChange,
    MinDelay,
    Rate,
    PayloadThatPanicsToo,
}

/// Panics when it is dropped, unless it was taken apart before.
struct Bomb {
    armed: bool,
}

impl Drop for Bomb {
    fn drop(&mut self) {
        if std::mem::take(&mut self.armed) && !std::thread::panicking() {
            panic!("the bomb went off");
        }
    }
}

/// What a panic throws: dropping it panics as well.
struct Payload(#[expect(dead_code, reason = "there to be dropped")] Bomb);

#[derive(Deserialize)]
struct Call {
    armed: bool,
    spoils_encoding: bool,
}

impl Serialize for Call {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        assert!(!self.spoils_encoding, "the encoding went wrong");
        let mut call = out.serialize_struct("Call", 2)?;
        call.serialize_field("armed", &self.armed)?;
        call.serialize_field("spoils_encoding", &self.spoils_encoding)?;
        call.end()
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        drop(Bomb { armed: self.armed });
    }
}

/// Says so if it is told to.
fn asked(at: Fuse, fuse: Fuse) {
    assert_ne!(at, fuse, "asked about itself");
}

fn call(armed: bool) -> Call {
    Call {
        armed,
        spoils_encoding: false,
    }
}

#[derive(Default)]
struct Kept(Option<Bomb>);

/// Counts its calls. It crashes at 5 s and is started again at 8 s.
struct Rover {
    fuse: Fuse,
    _state: Bomb,
}

impl Actor for Rover {
    type Accepts = (Call,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        match self.fuse {
            Fuse::TimerOfTheCrashed => {
                ctx.timer(SimDuration::from_secs(6), call(true));
            }
            Fuse::CancelledTimer => {
                let timer = ctx.timer(SimDuration::from_secs(6), call(true));
                ctx.cancel(timer);
            }
            Fuse::DurableAtTheEnd => {
                ctx.durable::<Kept>()
                    .0
                    .get_or_insert_with(|| Bomb { armed: true });
            }
            Fuse::PayloadThatPanicsToo => {
                std::panic::panic_any(Payload(Bomb { armed: true }));
            }
            _ => {}
        }
        Ok(())
    }
}

impl Handler<Call> for Rover {
    fn handle(&mut self, mut call: Call, _ctx: &mut Context<'_, Self>) -> Outcome {
        call.armed = false;
        Ok(())
    }
}

/// Calls the rover each second, and may ask its link to change.
struct Base(Fuse, Option<LinkId<Retune>>);

impl Actor for Base {
    type Accepts = (Call,);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), call(false));
        Ok(())
    }
}

impl Handler<Call> for Base {
    fn handle(&mut self, _call: Call, ctx: &mut Context<'_, Self>) -> Outcome {
        let rover = ctx.lookup::<Rover>("rover")?;
        let now = ctx.now();
        let message = Call {
            armed: match self.0 {
                Fuse::MessageToTheCrashed => now == SimTime::from_secs(6),
                Fuse::MessageInFlight | Fuse::MessageLostLate => now == SimTime::from_secs(9),
                Fuse::EncodingAndDrop => now == SimTime::from_secs(3),
                _ => false,
            },
            spoils_encoding: match self.0 {
                Fuse::Encoding | Fuse::EncodingAndDrop => now == SimTime::from_secs(3),
                Fuse::EncodingInFlight => now == SimTime::from_secs(9),
                _ => false,
            },
        };
        ctx.send(rover, message);
        if let Some(link) = self.1
            && now == SimTime::from_secs(4)
        {
            let spoils_encoding = false;
            ctx.tell_link(link, Retune { spoils_encoding });
        }
        ctx.timer(SimDuration::from_secs(1), call(false));
        Ok(())
    }
}

#[derive(Deserialize)]
struct Retune {
    spoils_encoding: bool,
}

impl Serialize for Retune {
    fn serialize<S: Serializer>(&self, out: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct;
        assert!(!self.spoils_encoding, "the encoding went wrong");
        let mut retune = out.serialize_struct("Retune", 1)?;
        retune.serialize_field("spoils_encoding", &self.spoils_encoding)?;
        retune.end()
    }
}

struct Link {
    fuse: Fuse,
    _own: Bomb,
}

impl Carrier for Link {
    type Change = Retune;

    fn min_delay(&self) -> SimDuration {
        asked(Fuse::MinDelay, self.fuse);
        SimDuration::from_millis(600)
    }

    fn rate_bit_per_s(&self) -> Option<u64> {
        asked(Fuse::Rate, self.fuse);
        None
    }

    fn carry(&mut self, _parcel: &Parcel<'_>, verdicts: &mut Verdicts) {
        asked(Fuse::OwnLink, self.fuse);
        asked(Fuse::SharedLink, self.fuse);
        if self.fuse == Fuse::MessageLostLate {
            verdicts.lose_after(SimDuration::from_millis(600), "faded");
        } else {
            verdicts.deliver(SimDuration::from_millis(600));
        }
    }

    fn change(&mut self, _change: Retune, _now: SimTime) {
        panic!("the change went wrong");
    }
}

/// Ten seconds of a base that calls a rover.
fn model(fuse: Fuse, heavy: bool) -> Simulation {
    let mut sim = Simulation::new(1);
    let (base, rover) = (sim.host("base"), sim.host("rover"));
    if heavy {
        sim.heavy(base);
        sim.heavy(rover);
    }
    let own = Bomb {
        armed: fuse == Fuse::ConstructorsOwnAtTheEnd,
    };
    let built = std::sync::atomic::AtomicU32::new(0);
    let target = sim.actor(rover, "rover", move |_| {
        let _ = &own;
        let before = built.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let first = before == 0;
        if first && fuse == Fuse::Constructor || !first && fuse == Fuse::ConstructorAtRestart {
            panic!("the constructor went wrong");
        }
        Rover {
            fuse,
            _state: Bomb {
                armed: match fuse {
                    Fuse::StateAtCrash | Fuse::StateAtRestart => first,
                    Fuse::StateAtTheEnd => !first,
                    _ => false,
                },
            },
        }
    });
    let link = Link {
        fuse,
        _own: Bomb {
            armed: fuse == Fuse::LinkAtTheEnd,
        },
    };
    let link = if fuse == Fuse::SharedLink {
        let link = sim.shared_link("base-rover", link);
        sim.route(base, rover, link);
        link
    } else {
        sim.link(base, rover, "base-rover", link)
    };
    let told = (fuse == Fuse::ChangeByActor).then_some(link);
    sim.actor(base, "base", move |_| Base(fuse, told));
    if fuse != Fuse::StateAtRestart {
        sim.crash_at(SimTime::from_secs(5), target);
    }
    sim.restart_at(SimTime::from_secs(8), target);
    match fuse {
        Fuse::ToldToTheCrashed => sim.tell_at(SimTime::from_secs(6), target, call(true)),
        Fuse::ToldTooLate => sim.tell_at(SimTime::from_secs(60), target, call(true)),
        Fuse::ChangeOfLink | Fuse::EncodingOfChange => {
            let spoils_encoding = fuse == Fuse::EncodingOfChange;
            sim.change_at(SimTime::from_secs(2), link, Retune { spoils_encoding });
        }
        Fuse::EncodingOfTold => {
            let spoiled = Call {
                armed: true,
                spoils_encoding: true,
            };
            sim.tell_at(SimTime::from_secs(3), target, spoiled);
        }
        _ => {}
    }
    sim.stop_at(SimTime::from_nanos(9_500_000_000), "long enough");
    sim
}

/// The fault of the model, on which all executors agree, and what its log says.
fn fault_of(fuse: Fuse) -> Box<Fault> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let mut reports = Vec::new();
    for (executor, heavy) in [
        (Executor::Inline, false),
        (Executor::Kameo { threads: 1 }, false),
        (Executor::Kameo { threads: 2 }, true),
    ] {
        let mut sim = model(fuse, heavy);
        let options = LogOptions::default();
        sim.observe(LogWriter::create(&path, options).expect("the log can be created"));
        let report = sim.run(executor).expect("the model can start");
        let log = info(&path).expect("it is a log");
        assert_eq!(log.missing, [""; 0], "{fuse:?}");
        let run = log.run.expect("of a run");
        assert_eq!(run.end.as_deref(), Some("fault"), "{fuse:?}");
        assert_eq!(run.end_detail, report.end.detail(), "{fuse:?}");
        let counts = &report.counts;
        assert_eq!(
            counts.sent,
            counts.delivered + counts.lost + counts.in_flight,
            "{fuse:?}: a message has no fate"
        );
        reports.push(report);
    }
    for other in &reports[1..] {
        assert_eq!(reports[0], *other, "{fuse:?}");
    }
    match reports.remove(0).end {
        End::Fault(fault) => fault,
        end => panic!("{fuse:?}: {end:?}"),
    }
}

#[test]
fn a_panic_anywhere_is_a_fault_that_says_who_and_when() {
    let bomb = "rover: panicked while it was dropped: the bomb went off";
    for (fuse, at_ms, said) in [
        (
            Fuse::Constructor,
            0,
            "rover: panicked: the constructor went wrong",
        ),
        (
            Fuse::ConstructorAtRestart,
            8000,
            "rover: panicked: the constructor went wrong",
        ),
        (Fuse::StateAtCrash, 5000, bomb),
        (Fuse::StateAtRestart, 8000, bomb),
        (Fuse::StateAtTheEnd, 9500, bomb),
        (Fuse::DurableAtTheEnd, 9500, bomb),
        (Fuse::ConstructorsOwnAtTheEnd, 9500, bomb),
        (
            Fuse::LinkAtTheEnd,
            9500,
            "base-rover: panicked while it was dropped: the bomb went off",
        ),
        (
            Fuse::ChangeOfLink,
            2000,
            "base-rover: panicked: the change went wrong",
        ),
        (
            Fuse::ChangeByActor,
            4000,
            "base-rover: panicked: the change went wrong",
        ),
        (
            Fuse::OwnLink,
            1000,
            "base-rover handling Call from base: panicked: assertion `left != right` failed: asked about itself",
        ),
        (
            Fuse::SharedLink,
            1000,
            "base-rover handling a message from base: panicked: assertion `left != right` failed: asked about itself",
        ),
        (
            Fuse::MessageToTheCrashed,
            6600,
            "rover handling Call from base: panicked while it was dropped: the bomb went off",
        ),
        (
            Fuse::TimerOfTheCrashed,
            6000,
            "rover handling Call from rover: panicked while it was dropped: the bomb went off",
        ),
        (
            Fuse::CancelledTimer,
            0,
            "rover: panicked: the bomb went off",
        ),
        (
            Fuse::MessageLostLate,
            9500,
            "rover handling Call from base: panicked while it was dropped: the bomb went off",
        ),
        (
            Fuse::MessageInFlight,
            9500,
            "rover handling Call from base: panicked while it was dropped: the bomb went off",
        ),
        (
            Fuse::ToldToTheCrashed,
            6000,
            "rover handling Call from @control: panicked while it was dropped: the bomb went off",
        ),
        (Fuse::ToldTooLate, 9500, bomb),
        (
            Fuse::Encoding,
            3600,
            "base-rover handling Call: panicked: the encoding went wrong",
        ),
        // Dropping the message panics as well: the first fault stands.
        (
            Fuse::EncodingAndDrop,
            3600,
            "base-rover handling Call: panicked: the encoding went wrong",
        ),
        (
            Fuse::EncodingInFlight,
            9500,
            "rover handling Call from base: panicked: the encoding went wrong",
        ),
        (
            Fuse::EncodingOfTold,
            3000,
            "rover handling Call: panicked: the encoding went wrong",
        ),
        (
            Fuse::EncodingOfChange,
            2000,
            "base-rover: panicked: the encoding went wrong",
        ),
        (
            Fuse::MinDelay,
            0,
            "base-rover: panicked: assertion `left != right` failed: asked about itself",
        ),
        (
            Fuse::Rate,
            0,
            "base-rover: panicked: assertion `left != right` failed: asked about itself",
        ),
        (
            Fuse::PayloadThatPanicsToo,
            0,
            "rover: panicked: a value that is no text",
        ),
    ] {
        let fault = fault_of(fuse);
        let told = fault.to_string();
        let (who, what) = said.split_once(':').expect("a name and the cause");
        let (actor, message) = who.split_once(" handling ").unwrap_or((who, ""));
        assert_eq!(fault.actor, actor, "{fuse:?}: {told}");
        assert_eq!(
            fault.message.as_deref().unwrap_or(""),
            message,
            "{fuse:?}: {told}"
        );
        assert_eq!(fault.time.as_nanos(), at_ms * 1_000_000, "{fuse:?}: {told}");
        assert!(told.contains(what), "{fuse:?}: {told}");
    }
}

/// A monitor that panics at the third record, when it is asked what it wants, at the begin, or at the
/// end.
struct Watcher {
    records: u32,
    breaks_at: Option<u32>,
    breaks_first: Option<First>,
    _bomb: Bomb,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum First {
    Wants,
    Begin,
}

impl Observer for Watcher {
    fn wants(&self) -> Wants {
        assert_ne!(
            self.breaks_first,
            Some(First::Wants),
            "the watcher went wrong"
        );
        Wants::default()
    }

    fn begin(&mut self, _run: &std::sync::Arc<farside::RunInfo>) -> Result<(), ObserverError> {
        assert_ne!(
            self.breaks_first,
            Some(First::Begin),
            "the watcher went wrong"
        );
        Ok(())
    }

    fn record(&mut self, _record: &Record<'_>) -> Result<Flow, ObserverError> {
        self.records += 1;
        assert_ne!(Some(self.records), self.breaks_at, "the watcher went wrong");
        Ok(Flow::Continue)
    }
}

#[test]
fn an_observer_that_panics_ends_the_run_like_one_that_fails() {
    for (breaks_at, armed, said) in [
        (Some(3), false, "an observer panicked: "),
        (
            None,
            true,
            "an observer panicked while it was dropped: the bomb went off",
        ),
    ] {
        for executor in [Executor::Inline, Executor::Kameo { threads: 2 }] {
            let mut sim = model(Fuse::ToldTooLate, false);
            let bomb = Bomb { armed };
            sim.observe(Watcher {
                records: 0,
                breaks_at,
                breaks_first: None,
                _bomb: bomb,
            });
            let report = sim.run(executor).expect("the model can start");
            let End::ObserverFailed(failure) = &report.end else {
                panic!("{:?}", report.end);
            };
            assert!(failure.starts_with(said), "{failure}");
            assert!(failure.ends_with("panics::Watcher)"), "{failure}");
        }
    }
}

/// What was brought in is dropped all the same, whatever of it panics then.
#[test]
fn an_observer_that_panics_before_the_start_keeps_a_run_from_starting() {
    for first in [First::Wants, First::Begin] {
        let error = agreed(|heavy| {
            let mut sim = model(Fuse::LinkAtTheEnd, heavy);
            sim.observe(Watcher {
                records: 0,
                breaks_at: None,
                breaks_first: Some(first),
                _bomb: Bomb { armed: true },
            });
            sim
        });
        let error = error.expect_err("it cannot start").to_string();
        assert!(
            error.starts_with("an observer panicked: "),
            "{first:?}: {error}"
        );
        assert!(error.ends_with("panics::Watcher)"), "{first:?}: {error}");
    }
}

/// Its `Deserialize` panics when it is traced, before there is anybody who could handle one.
#[derive(Serialize)]
struct Untraceable;

impl<'de> Deserialize<'de> for Untraceable {
    fn deserialize<D: serde::Deserializer<'de>>(_: D) -> Result<Self, D::Error> {
        panic!("not to be read")
    }
}

struct Mute;

impl Actor for Mute {
    type Accepts = (Untraceable,);
}

impl Handler<Untraceable> for Mute {
    fn handle(&mut self, _message: Untraceable, _ctx: &mut Context<'_, Self>) -> Outcome {
        Ok(())
    }
}

#[test]
fn a_type_that_panics_when_it_is_traced_is_named() {
    let error = agreed(|heavy| {
        let mut sim = model(Fuse::LinkAtTheEnd, heavy);
        let host = sim.host("rover");
        let mute = sim.actor(host, "mute", |_| Mute);
        sim.tell_at(SimTime::from_secs(1), mute, Untraceable);
        sim
    });
    let error = error.expect_err("it cannot start").to_string();
    assert!(
        error.contains("Untraceable: panicked: not to be read"),
        "{error}"
    );
}

#[test]
fn a_run_that_fails_ends_with_its_first_fault() {
    // The constructor's own state blows up at the end as well.
    let mut sim = model(Fuse::ConstructorsOwnAtTheEnd, false);
    let link = sim.shared_link(
        "other",
        Link {
            fuse: Fuse::ChangeOfLink,
            _own: Bomb { armed: true },
        },
    );
    let retune = Retune {
        spoils_encoding: false,
    };
    sim.change_at(SimTime::from_secs(2), link, retune);
    let report = sim.run(Executor::Inline).expect("the model can start");
    let fault = report.fault().expect("a fault");
    assert_eq!(
        fault.cause,
        FaultCause::Panic("the change went wrong".to_owned())
    );
}

//! The hold model in NeXosim: an event waits at its sender, which then sends it through the output
//! port to its target, as the framework's own examples delay events.

use std::time::Duration;

use farside::random::{RandomKey, Stream};
use nexosim::model::{Context, Model, schedulable};
use nexosim::ports::Output;
use nexosim::simulation::{Mailbox, SimInit};
use nexosim::time::MonotonicTime;
use serde::{Deserialize, Serialize};

use crate::{LOOK_AHEAD_NS, MEAN_NS, Size};

/// The same job as Farside's: 24 bytes. `to` stands where Farside has a payload.
#[derive(Clone, Serialize, Deserialize)]
struct Job {
    id: u64,
    hops: u64,
    to: u64,
}

#[derive(Serialize, Deserialize)]
struct Holder {
    outputs: Vec<Output<Job>>,
    population: u32,
    #[serde(skip)]
    stream: Option<Stream>,
    handled: u64,
}

#[Model]
impl Holder {
    #[nexosim(init)]
    async fn init(&mut self, cx: &Context<Self>) {
        for id in 0..u64::from(self.population) {
            self.pass(Job { id, hops: 0, to: 0 }, cx);
        }
    }

    fn pass(&mut self, job: Job, cx: &Context<Self>) {
        let Some(stream) = &mut self.stream else {
            return;
        };
        let to = stream.below(self.outputs.len() as u64);
        let delay = Duration::from_nanos(LOOK_AHEAD_NS + stream.exponential(MEAN_NS) as u64);
        cx.schedule_event(delay, schedulable!(Self::emit), Job { to, ..job })
            .expect("the delay is positive");
    }

    #[nexosim(schedulable)]
    async fn emit(&mut self, job: Job) {
        let to = job.to as usize;
        self.outputs[to].send(job).await;
    }

    async fn receive(&mut self, job: Job, cx: &Context<Self>) {
        self.handled += 1;
        self.pass(
            Job {
                hops: job.hops + 1,
                ..job
            },
            cx,
        );
    }
}

/// One thread. Returns how many events were handled, in the mean.
pub fn run(size: Size) -> u64 {
    let mailboxes: Vec<Mailbox<Holder>> = (0..size.actors).map(|_| Mailbox::new()).collect();
    let mut bench = SimInit::with_num_threads(1);
    let holders: Vec<Holder> = (0..size.actors)
        .map(|at| {
            let connect = |mailbox| {
                let mut output = Output::new();
                output.connect(Holder::receive, mailbox);
                output
            };
            Holder {
                outputs: mailboxes.iter().map(connect).collect(),
                population: size.population,
                stream: Some(RandomKey::new(u64::from(at)).text("hold").stream()),
                handled: 0,
            }
        })
        .collect();
    for (at, (holder, mailbox)) in holders.into_iter().zip(mailboxes).enumerate() {
        bench = bench.add_model(holder, mailbox, &format!("holder_{at}"));
    }
    let mut simulation = bench
        .init(MonotonicTime::EPOCH)
        .expect("the bench can start");
    let in_flight = f64::from(size.actors) * f64::from(size.population);
    let until_ns = size.events as f64 / in_flight * (LOOK_AHEAD_NS as f64 + MEAN_NS);
    let until = MonotonicTime::EPOCH + Duration::from_nanos(until_ns as u64);
    simulation
        .step_until(until)
        .expect("the model does not fail");
    size.events
}

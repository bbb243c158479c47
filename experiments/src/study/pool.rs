//! The pool of workers: kameo actors on tokio's threads, one for each run at a time.
//!
//! The order in which results come back is that of the wall clock: whoever is told must not depend
//! on it. kameo's identities, supervision and streams stay out of it: a worker is known by its
//! place, and what can panic is caught by whoever gives the work.

use std::convert::Infallible;
use std::sync::Arc;

use kameo::Actor;
use kameo::actor::{ActorRef, Spawn};
use kameo::message::{Context, Message};
use tokio::sync::mpsc;

/// Gives work, and is told what came of it.
pub(super) trait Dispatch {
    /// A piece of work.
    type Job: Send + 'static;
    /// What comes of it.
    type Done: Send + 'static;

    /// The next piece of work; none if there is none now. It is asked again whenever a piece is
    /// done.
    fn next(&mut self) -> Option<Self::Job>;

    /// A piece of work is done.
    fn done(&mut self, done: Self::Done);
}

type Work<D> = Arc<dyn Fn(<D as Dispatch>::Job) -> <D as Dispatch>::Done + Send + Sync>;

/// Does all work there is on `workers` threads. `work` must not panic.
pub(super) fn run<D: Dispatch>(
    workers: usize,
    work: impl Fn(D::Job) -> D::Done + Send + Sync + 'static,
    dispatch: &mut D,
) -> Result<(), std::io::Error> {
    let workers = workers.max(1);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(workers)
        .thread_name("farside-study")
        .build()?;
    let work: Work<D> = Arc::new(work);
    runtime.block_on(async {
        let (report, mut reports) = mpsc::unbounded_channel();
        let spawn = |place| {
            Worker::spawn(Worker {
                place,
                work: work.clone(),
                report: report.clone(),
            })
        };
        let pool: Vec<ActorRef<Worker<D::Job, D::Done>>> = (0..workers).map(spawn).collect();
        let mut idle: Vec<usize> = (0..workers).collect();
        loop {
            while let Some(place) = idle.pop() {
                let Some(job) = dispatch.next() else {
                    idle.push(place);
                    break;
                };
                let told = pool[place].tell(Task(job)).await;
                told.unwrap_or_else(|error| lost_worker(&error));
            }
            if idle.len() == workers {
                return Ok(());
            }
            // The channel stays open: this end of it holds a sender.
            let Some((place, done)) = reports.recv().await else {
                return Ok(());
            };
            idle.push(place);
            dispatch.done(done);
        }
    })
}

/// Work does not panic; a worker that is gone is a bug of this pool.
fn lost_worker(error: &dyn std::fmt::Display) {
    panic!("a worker takes no work: {error}")
}

struct Worker<J, R> {
    place: usize,
    work: Arc<dyn Fn(J) -> R + Send + Sync>,
    report: mpsc::UnboundedSender<(usize, R)>,
}

impl<J: Send + 'static, R: Send + 'static> Actor for Worker<J, R> {
    type Args = Self;
    type Error = Infallible;

    async fn on_start(args: Self, _: ActorRef<Self>) -> Result<Self, Infallible> {
        Ok(args)
    }
}

struct Task<J>(J);

impl<J: Send + 'static, R: Send + 'static> Message<Task<J>> for Worker<J, R> {
    type Reply = ();

    async fn handle(&mut self, task: Task<J>, _: &mut Context<Self, Self::Reply>) {
        let done = (self.work)(task.0);
        // Nobody listens any more when the pool is torn down.
        let _ = self.report.send((self.place, done));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Numbers {
        next: u32,
        done: Vec<u32>,
    }

    impl Dispatch for Numbers {
        type Job = u32;
        type Done = u32;

        fn next(&mut self) -> Option<u32> {
            // The second half is only known once the first one is done.
            let known = if self.done.len() < 50 { 50 } else { 100 };
            let next = (self.next < known).then_some(self.next)?;
            self.next += 1;
            Some(next)
        }

        fn done(&mut self, done: u32) {
            self.done.push(done);
        }
    }

    #[test]
    fn all_work_is_done_once_by_any_number_of_workers() {
        for workers in [1, 2, 7] {
            let mut numbers = Numbers {
                next: 0,
                done: Vec::new(),
            };
            run(workers, |number| number * 2, &mut numbers).unwrap();
            numbers.done.sort_unstable();
            let expected: Vec<u32> = (0..100).map(|number| number * 2).collect();
            assert_eq!(numbers.done, expected);
        }
    }
}

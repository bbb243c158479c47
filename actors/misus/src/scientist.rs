//! The scientist: one actor on each rover. It sends the rover from rock to rock, keeps what is read,
//! exchanges it with the other rovers, and learns from all of it. It knows no plan: what comes next
//! is decided when something has ended.
//!
//! What it has read lies in its memory, which a crash empties; then it begins a new incarnation, and
//! the others give back what they had heard. Which rocks it has been to is durable.

mod touring;

use farside::prelude::*;
use farside_actors::rover::{
    Command, CommandReport, RenewLease, RoverCommand, RoverHardware, RoverQuery, RoverState,
    hardware_name,
};

use crate::analysis::exchange::Statistics;
use crate::learner::Learner;
use crate::learning::Lesson;
use crate::messages::{ExchangeDue, GoOn, LeaseDue, LessonDue, Overdue};
use crate::site::SharedSite;
use touring::{Doing, Logbook};

/// The longest that a command may take before it is stopped. A drive across the largest field in
/// hours would be longer, but tours go from rock to near rock.
const OVERDUE: SimDuration = SimDuration::from_secs(4 * 3600);

/// One rover's scientist.
pub(crate) struct Scientist {
    site: SharedSite,
    number: u32,
    learner: Learner,
    doing: Doing,
    /// The command that is waited for, and the timer that ends the wait.
    waits_for: Option<(u32, TimerId)>,
    /// Rocks since the last panoramic image; none before the first.
    since_panorama: Option<u32>,
}

impl Scientist {
    /// The scientist of the rover of this number.
    pub(crate) fn new(site: SharedSite, number: u32) -> Scientist {
        let peers = site.peers(number);
        let peers = peers.map(|(peer, name)| (peer, name.to_owned()));
        let learner = Learner::new(site.clone(), number, peers.collect());
        Scientist {
            site,
            number,
            learner,
            doing: Doing::Asking,
            waits_for: None,
            since_panorama: None,
        }
    }

    fn hardware(&self, ctx: &Context<'_, Self>) -> Result<Address<RoverHardware>, HandlerError> {
        let rover = &self.site.rovers[self.number as usize];
        Ok(ctx.lookup::<RoverHardware>(&hardware_name(rover))?)
    }

    /// Gives a command, and waits for its end.
    fn command(&mut self, ctx: &mut Context<'_, Self>, doing: Doing, command: Command) -> Outcome {
        let hardware = self.hardware(ctx)?;
        let logbook = ctx.durable::<Logbook>();
        logbook.commands += 1;
        let id = logbook.commands;
        if let Some((_, timer)) = self.waits_for.take() {
            ctx.cancel(timer);
        }
        let longest = match &command {
            Command::Sleep { duration } | Command::Heat { duration } => OVERDUE + *duration,
            _ => OVERDUE,
        };
        let timer = ctx.timer(longest, Overdue { command: id });
        self.waits_for = Some((id, timer));
        self.doing = doing;
        ctx.send(hardware, RoverCommand { id, command });
        Ok(())
    }

    /// Asks the hardware how it is; the answer begins what comes next.
    fn ask(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        let hardware = self.hardware(ctx)?;
        self.doing = Doing::Asking;
        ctx.send(hardware, RoverQuery { id: 0 });
        Ok(())
    }
}

impl Actor for Scientist {
    type Accepts = (
        LeaseDue,
        ExchangeDue,
        LessonDue,
        GoOn,
        Overdue,
        CommandReport,
        RoverState,
        Statistics,
    );

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        self.learner.begin(ctx.incarnation());
        if let Some(every) = self.site.renew_every {
            ctx.timer(every, LeaseDue);
        }
        self.learner.schedule_exchange(ctx);
        ctx.timer(self.site.config.learn_every, LessonDue);
        let logbook = ctx.durable::<Logbook>();
        logbook.visited.resize(self.site.catalogue.len(), false);
        if ctx.incarnation() > 0 {
            // Whatever the hardware was told before the crash is not waited for any more.
            let hardware = self.hardware(ctx)?;
            let id = 0;
            let command = Command::Stop { part: None };
            ctx.send(hardware, RoverCommand { id, command });
        }
        self.ask(ctx)
    }
}

impl Handler<LeaseDue> for Scientist {
    fn handle(&mut self, _: LeaseDue, ctx: &mut Context<'_, Self>) -> Outcome {
        let hardware = self.hardware(ctx)?;
        ctx.send(hardware, RenewLease);
        if let Some(every) = self.site.renew_every {
            ctx.timer(every, LeaseDue);
        }
        Ok(())
    }
}

impl Handler<GoOn> for Scientist {
    fn handle(&mut self, _: GoOn, ctx: &mut Context<'_, Self>) -> Outcome {
        self.ask(ctx)
    }
}

impl Handler<Overdue> for Scientist {
    fn handle(&mut self, overdue: Overdue, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.waits_for.is_some_and(|(id, _)| id == overdue.command) {
            // Its report comes at once, and is taken like any other.
            let hardware = self.hardware(ctx)?;
            let command = Command::Stop { part: None };
            ctx.send(hardware, RoverCommand { id: 0, command });
        }
        Ok(())
    }
}

impl Handler<ExchangeDue> for Scientist {
    fn handle(&mut self, _: ExchangeDue, ctx: &mut Context<'_, Self>) -> Outcome {
        if self.site.is_in_contact(ctx.now()) {
            self.learner.exchange(ctx)?;
        }
        self.learner.schedule_exchange(ctx);
        Ok(())
    }
}

impl Handler<LessonDue> for Scientist {
    fn handle(&mut self, _: LessonDue, ctx: &mut Context<'_, Self>) -> Outcome {
        self.learn(ctx);
        ctx.timer(self.site.config.learn_every, LessonDue);
        Ok(())
    }
}

impl Handler<Statistics> for Scientist {
    fn handle(&mut self, statistics: Statistics, _: &mut Context<'_, Self>) -> Outcome {
        self.learner.hear(&statistics);
        Ok(())
    }
}

impl Scientist {
    /// Learns from all readings, if there are new ones, and records what it thinks then.
    fn learn(&mut self, ctx: &mut Context<'_, Self>) {
        let stops = ctx.durable::<Logbook>().stops;
        if let Some(model) = self.learner.learn(stops) {
            ctx.sample(&model);
        }
    }

    /// Of some rocks the one that the prioritiser values most, by all that is known now. Before
    /// anything is known there is nothing to choose by.
    fn most_wanted(&mut self, ctx: &mut Context<'_, Self>, left: &[u32]) -> Option<u32> {
        self.learn(ctx);
        let wanted = |lesson: &Lesson| lesson.most_wanted(&self.site, left);
        self.learner.lesson().and_then(wanted)
    }
}

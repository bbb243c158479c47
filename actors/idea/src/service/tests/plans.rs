//! What deliberative planners commit.

use smallvec::smallvec;

use super::*;

impl Agent {
    /// A step that goes to a place, with what follows it.
    fn go_to(&self, place: Value, not_before: Ticks, next: &[(Option<&str>, usize)]) -> Step {
        let branch = |&(when, next): &(Option<&str>, usize)| Branch {
            when: when.map(|status| (1, self.symbol(status))),
            next,
        };
        Step {
            predicate: self.predicate("GoTo"),
            inputs: smallvec![place],
            not_before,
            branches: next.iter().map(branch).collect(),
        }
    }

    fn commit(&mut self, steps: Vec<Step>) -> Result<(), Stale> {
        let snapshot = self.service.snapshot();
        let timeline = self.timeline("Goal_SV");
        self.service.commit(&snapshot, Plan { timeline, steps })
    }

    /// The place of the present goal, and since when; none without a goal.
    fn place(&self) -> Option<(Value, Ticks)> {
        let present = self.service.present(self.timeline("Goal_SV"))?;
        let is_goal = present.predicate == self.predicate("GoTo");
        is_goal.then(|| (present.parameters[0].expect("an input"), present.start))
    }
}

#[test]
fn a_plan_follows_the_branch_that_holds_when_its_time_has_come() {
    for (status, place) in [("ok", 20), ("failed", 30)] {
        for mut agent in agents(TEXT) {
            let plan = vec![
                agent.go_to(10, 3, &[(Some("ok"), 1), (None, 2)]),
                agent.go_to(20, 9, &[]),
                agent.go_to(30, 3, &[]),
            ];
            agent.commit(plan).expect("it is a plan");
            agent.idle(1..3);
            assert_eq!(agent.place(), None);
            agent.cycle(3);
            assert_eq!(agent.place(), Some((10, 3)));
            agent.service.advance(6);
            agent.status("Goal_SV", status).expect("it is active");
            agent.idle(6..12);
            let start = if status == "ok" { 9 } else { 6 };
            assert_eq!(agent.place(), Some((place, start)));
            // No branch of the last step: the plan is over.
            agent.service.advance(12);
            agent.status("Goal_SV", "ok").expect("it is active");
            agent.idle(12..20);
            assert_eq!(agent.place(), None);
        }
    }
}

#[test]
fn a_goal_or_a_cancel_wins_over_a_plan() {
    for cancels in [true, false] {
        for mut agent in agents(TEXT) {
            agent.service.advance(1);
            agent.goal("Goal_SV", "GoTo", &[5]).expect("it can start");
            agent.cycle(1);
            let plan = vec![agent.go_to(10, 3, &[])];
            agent.commit(plan).expect("it is a plan");
            agent.idle(2..4);
            assert_eq!(agent.place(), Some((5, 1)), "the plan waits for its end");
            agent.service.advance(4);
            if cancels {
                let goal = agent.contract("Goal_SV");
                agent.service.cancel(goal).expect("it is active");
            } else {
                agent
                    .goal("Goal_SV", "GoTo", &[6])
                    .expect("the first may end");
            }
            agent.cycle(4);
            assert_eq!(agent.place(), (!cancels).then_some((6, 4)));
            if !cancels {
                agent.service.advance(5);
                agent.status("Goal_SV", "ok").expect("it is active");
            }
            agent.idle(5..10);
            assert_eq!(agent.place(), None, "nothing is left of the plan");
        }
    }
}

#[test]
fn a_plan_that_the_mode_does_not_let_start_waits() {
    for mut agent in agents(TEXT) {
        let plan = vec![agent.go_to(10, 2, &[])];
        agent.commit(plan).expect("it is a plan");
        agent.service.advance(1);
        let poll = agent.contract("Poll_SV");
        agent
            .service
            .bind(poll, &[None, Some(26), Some(1)], true)
            .expect("it is active");
        agent.idle(1..5);
        assert_eq!(agent.says("Mode_SV"), ("Hold", 1));
        assert_eq!(agent.place(), None);
        agent.cycle(5);
        assert_eq!(agent.says("Mode_SV"), ("Nominal", 5));
        assert_eq!(agent.place(), Some((10, 5)));
    }
}

#[test]
fn a_dropped_plan_is_not_followed() {
    for mut agent in agents(TEXT) {
        let plan = vec![agent.go_to(10, 3, &[])];
        agent.commit(plan).expect("it is a plan");
        agent.cycle(1);
        agent.service.drop_plan(agent.timeline("Goal_SV"));
        agent.idle(2..6);
        assert_eq!(agent.place(), None);
    }
}

#[test]
fn what_is_stale_or_no_plan_is_not_taken() {
    for mut agent in agents(TEXT) {
        let old = agent.service.snapshot();
        agent.service.advance(1);
        agent.goal("Goal_SV", "GoTo", &[5]).expect("it can start");
        let posted = vec![agent.go_to(10, 9, &[])];
        assert!(matches!(agent.commit(posted), Err(Stale::Changed { .. })));
        agent.cycle(1);
        let timeline = agent.timeline("Goal_SV");
        let steps = vec![agent.go_to(10, 9, &[])];
        let stale = agent.service.commit(&old, Plan { timeline, steps });
        assert!(matches!(stale, Err(Stale::Changed { .. })), "{stale:?}");

        let soon = vec![agent.go_to(10, 3, &[(None, 1)]), agent.go_to(10, 2, &[])];
        let stale = agent.commit(soon);
        assert_eq!(
            stale,
            Err(Stale::TooSoon {
                step: 1,
                at: 2,
                now: 2
            })
        );
        for bad in [
            vec![agent.go_to(10, 3, &[(None, 0)])],
            vec![agent.go_to(10, 3, &[(None, 1)])],
            vec![agent.go_to(101, 3, &[])],
        ] {
            let stale = agent.commit(bad);
            assert!(matches!(stale, Err(Stale::Malformed { step: 0, .. })));
        }
        let mut wrong = agent.go_to(10, 3, &[(Some("ok"), 1)]);
        wrong.branches[0].when = Some((0, 10));
        let stale = agent.commit(vec![wrong, agent.go_to(10, 3, &[])]);
        assert!(matches!(stale, Err(Stale::Malformed { step: 0, .. })));
        assert_eq!(agent.place(), Some((5, 1)));
    }
}

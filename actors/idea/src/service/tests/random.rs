//! Random models of executives, as text: forward-chaining, and such that there always is something
//! to do; and what happens to an agent, at random.

use proptest::prelude::*;

use super::*;

/// A model in numbers.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    /// By poll: its limit and how long it waits for an answer.
    polls: Vec<(i64, i64)>,
    /// By step of a recovery: how long it lasts at most.
    steps: Vec<i64>,
    /// By command: its least and greatest duration, and whether it follows the one before it.
    commands: Vec<(i64, i64, bool)>,
    /// Whether goals are contained by the nominal mode.
    contained: bool,
    /// Whether search control names the recovery first.
    ordered: bool,
}

pub(super) fn shapes() -> impl Strategy<Value = Shape> {
    let polls = prop::collection::vec((5..60_i64, 1..4_i64), 1..4);
    let steps = prop::collection::vec(1..6_i64, 1..4);
    let command = (1..4_i64, 0..5_i64, any::<bool>());
    let commands = prop::collection::vec(command, 1..4);
    let all = (polls, steps, commands, any::<bool>(), any::<bool>());
    all.prop_map(|(polls, steps, commands, contained, ordered)| Shape {
        polls,
        steps,
        commands,
        contained,
        ordered,
    })
}

impl Shape {
    /// Whether a goal may come when nothing can contain it.
    pub(super) fn may_fail(&self) -> bool {
        self.contained
    }

    /// The model's text.
    pub(super) fn text(&self) -> String {
        let mut text = String::from("(Define_Model random :profile executive)\n");
        self.declare(&mut text);
        self.watch(&mut text);
        self.recover(&mut text);
        self.command(&mut text);
        if self.ordered {
            text += "(Define_Search_Control :subgoal_order ((Agent Mode_SV) Step0))\n";
        }
        text
    }

    fn declare(&self, text: &mut String) {
        let numbered = |name: &str, count: usize| {
            let names: Vec<String> = (0..count).map(|at| format!("{name}{at}_SV")).collect();
            names.join(" ")
        };
        let polls = numbered("Poll", self.polls.len());
        let commands = numbered("Command", self.commands.len());
        *text += &format!(
            "(Define_Object_Class Agent :state_variables
 ((Goal Goal_SV) (Executable Base_SV {commands}) (State {polls} Mode_SV)))
(Define_Type Status (ok failed TIMEOUT PREEMPTED))
(Define_Type Metres [0 1000])
(Define_Type Degrees [-90 90])
(Define_Predicate NoGoal ())
(Define_Predicate GoTo ((Metres ?x) -> (Status ?status)))
(Define_Predicate Still ())
(Define_Predicate Move ((Status ?why) -> (Status ?status)))
(Define_Predicate Nominal ())
(Define_Member_Values (Agent Goal_SV) (NoGoal GoTo) :default (NoGoal ()))
(Define_Member_Values (Agent Base_SV) (Still Move) :default (Still ()))
"
        );
        let mut steps = String::new();
        for step in 0..self.steps.len() {
            *text += &format!("(Define_Predicate Step{step} (-> (Status ?status)))\n");
            steps += &format!(" Step{step}");
        }
        *text += &format!(
            "(Define_Member_Values (Agent Mode_SV) (Nominal{steps}) :default (Nominal ()))\n"
        );
        for at in 0..self.polls.len() {
            *text += &format!(
                "(Define_Predicate Poll{at} (-> (Boolean ?alarm) (Degrees ?tilt) (Boolean ?got)))
(Define_Member_Values (Agent Poll{at}_SV) (Poll{at}) :default (Poll{at}))
"
            );
        }
        for at in 0..self.commands.len() {
            *text += &format!(
                "(Define_Predicate Idle{at} ())
(Define_Predicate Do{at} ((Metres ?x) -> (Status ?status)))
(Define_Member_Values (Agent Command{at}_SV) (Idle{at} Do{at}) :default (Idle{at} ()))
"
            );
        }
    }

    /// Polls, whose alarms begin a recovery unless there is one.
    fn watch(&self, text: &mut String) {
        for (at, (limit, waits)) in self.polls.iter().enumerate() {
            let mut masked = String::new();
            for step in 0..self.steps.len() {
                masked += &format!(
                    "\n  (ends_during :condition (SINGLE ((Agent Mode_SV) ((Step{step})))))"
                );
            }
            *text += &format!(
                "(Define_Compatibility (SINGLE ((Agent Poll{at}_SV) ((Poll{at}))))
 :duration_bounds [1 {waits}])
(Define_Compatibility (SINGLE ((Agent Poll{at}_SV) ((Poll{at} (-> ?alarm ?tilt True)))))
 :parameter_functions (abs (?tilt ?size) exceeds (?size {limit} ?alarm)))
(Define_Compatibility (SINGLE ((Agent Poll{at}_SV) ((Poll{at} (-> True ?tilt True)))))
 :compatibility_spec
 (OR{masked}
  (meets (SINGLE ((Agent Mode_SV) ((Step0 (-> ?status))))))))
"
            );
        }
    }

    /// Each step lasts as long as its command, and the next one follows if it was well.
    fn recover(&self, text: &mut String) {
        for (step, most) in self.steps.iter().enumerate() {
            *text += &format!(
                "(Define_Compatibility (SINGLE ((Agent Mode_SV) ((Step{step} (-> ?status)))))
 :duration_bounds [1 {most}]
 :compatibility_spec (equals (SINGLE ((Agent Base_SV) ((Move (ok -> ?status)))))))
"
            );
            if step + 1 < self.steps.len() {
                *text += &format!(
                    "(Define_Compatibility (SINGLE ((Agent Mode_SV) ((Step{step} (-> ok)))))
 :compatibility_spec (meets (SINGLE ((Agent Mode_SV) ((Step{} (-> ?status)))))))
",
                    step + 1
                );
            }
            *text += &format!(
                "(Define_Compatibility (SINGLE ((Agent Mode_SV) ((Step{step} (-> ?status)))))
 :when (!= ?status ok)
 :compatibility_spec (meets (SINGLE ((Agent Mode_SV) ((Nominal ()))))))
"
            );
        }
    }

    /// A goal starts the first command, unless that goes on; others follow it, and the first that
    /// is not well ends the goal.
    fn command(&self, text: &mut String) {
        let contained = if self.contained {
            "(contained_by :condition (SINGLE ((Agent Mode_SV) ((Nominal ())))))"
        } else {
            ""
        };
        *text += &format!(
            "(Define_Compatibility (SINGLE ((Agent Goal_SV) ((GoTo (?x -> ?status)))))
 :duration_bounds [1 40]
 :compatibility_spec
 (AND {contained}
  (OR
   (starts_during :condition (SINGLE ((Agent Command0_SV) ((Do0 (?y -> ?going))))))
   (starts (SINGLE ((Agent Command0_SV) ((Do0 (?x -> ?done)))))))))
"
        );
        for (at, (least, more, follows)) in self.commands.iter().enumerate() {
            *text += &format!(
                "(Define_Compatibility (SINGLE ((Agent Command{at}_SV) ((Do{at}))))
 :duration_bounds [{least} {}])
(Define_Compatibility (SINGLE ((Agent Command{at}_SV) ((Do{at} (?x -> ?status)))))
 :when (!= ?status ok)
 :compatibility_spec
 (OR
  (ends :condition (SINGLE ((Agent Goal_SV) ((GoTo (?y -> ?status))))))
  (ends_during :condition (SINGLE ((Agent Goal_SV) ((NoGoal ())))))
  (ends_during :condition (SINGLE ((Agent Goal_SV) ((GoTo (?z -> ?other))))))))
",
                least + more
            );
            let next = at + 1;
            if *follows && next < self.commands.len() {
                *text += &format!(
                    "(Define_Compatibility (SINGLE ((Agent Command{at}_SV) ((Do{at} (?x -> ok)))))
 :compatibility_spec
 (OR
  (ends_during :condition (SINGLE ((Agent Command{next}_SV) ((Do{next})))))
  (meets (SINGLE ((Agent Command{next}_SV) ((Do{next} (?x -> ?status))))))))
"
                );
            }
        }
    }
}

/// What happens to agents: the same to each that is asked, tick by tick.
pub(super) struct Stimuli {
    random: u64,
    /// By predicate: the outputs that follow from others.
    derived: Vec<Vec<usize>>,
}

/// What happens at a tick.
#[derive(Clone, Debug)]
pub(super) enum Event {
    Status(Contract, Vec<Option<Value>>, bool),
    Goal(TimelineId, PredicateId, Vec<Value>),
    Cancel(Contract),
}

impl Stimuli {
    pub(super) fn new(model: &Model, seed: u64) -> Self {
        let mut derived = vec![Vec::new(); model.predicates.len()];
        for rule in &model.rules {
            for said in &rule.relationships {
                let Some(farside_planning::model::Operand::Variable(last)) = said.operands.last()
                else {
                    continue;
                };
                let place = { rule.master.arguments.iter() }
                    .position(|at| *at == farside_planning::model::Argument::Variable(*last));
                derived[rule.master.predicate].extend(place);
            }
        }
        Stimuli {
            random: seed,
            derived,
        }
    }

    fn below(&mut self, limit: u64) -> i64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.random;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) % limit) as i64
    }

    fn value(&mut self, model: &Model, of: usize) -> Value {
        match &model.types[of].values {
            // That something came at all.
            farside_planning::model::Values::Truth => 1,
            farside_planning::model::Values::Numbers(span) => {
                span.min + self.below((span.max - span.min + 1) as u64)
            }
            farside_planning::model::Values::Symbols(all) => {
                let said: Vec<Value> = { all.iter().copied() }
                    .filter(|&at| {
                        !["TIMEOUT", "PREEMPTED"].contains(&model.symbols[at as usize].as_str())
                    })
                    .collect();
                said[self.below(said.len() as u64) as usize]
            }
        }
    }

    /// What happens next, as a service is.
    pub(super) fn next(&mut self, service: &dyn PlanService) -> Vec<Event> {
        let model = service.model().clone();
        let mut events = Vec::new();
        for timeline in 0..model.timelines.len() {
            let Some(present) = service.present(timeline) else {
                continue;
            };
            let said = &model.predicates[present.predicate];
            let outputs = said.inputs..said.parameters.len();
            let is_poll = outputs.len() > 1;
            if !outputs.is_empty() && self.below(if is_poll { 2 } else { 5 }) == 0 {
                let partly = self.below(6) == 0;
                let values = outputs.map(|place| {
                    let value = self.value(&model, said.parameters[place].of);
                    let skip = self.derived[present.predicate].contains(&place)
                        || (partly && self.below(2) == 0);
                    (!skip && present.parameters[place].is_none()).then_some(value)
                });
                events.push(Event::Status(present.contract, values.collect(), !partly));
            }
            if said.inputs > 0 && self.below(40) == 0 {
                events.push(Event::Cancel(present.contract));
            }
            if timeline == 0 && self.below(8) == 0 {
                let goal = model.timelines[timeline].predicates[1];
                let said = &model.predicates[goal];
                let inputs = 0..said.inputs;
                let inputs = inputs.map(|at| self.value(&model, said.parameters[at].of));
                events.push(Event::Goal(timeline, goal, inputs.collect()));
            }
        }
        events
    }
}

impl Event {
    pub(super) fn post(&self, service: &mut dyn PlanService) -> Result<(), String> {
        let posted = match self {
            Event::Status(contract, outputs, ends) => service.bind(*contract, outputs, *ends),
            Event::Goal(timeline, goal, inputs) => service.insert_goal(*timeline, *goal, inputs),
            Event::Cancel(contract) => service.cancel(*contract),
        };
        posted.map_err(|refusal| match refusal {
            Refusal::Rule { what, .. } => what,
            other => other.to_string(),
        })
    }
}

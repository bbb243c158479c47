//! What a database knows by ids, in words: tokens, whose a constraint is, times that cannot all be,
//! over-uses, and what is missing.

use super::{Part, Reason, ReasonKind, ToldGoal, ToldToken};
use crate::Ticks;
use crate::database::{Cause, Conflict, Database, Open, Owner, Step, Time, TokenId};
use crate::model::{End, Position, Problem, ResourceId, ResourceKind, Target};
use crate::plan::PlanToken;
use crate::profile::{Bound, OverUse};
use crate::search::{Decision, Flaw};
use crate::temporal::{self, Point};

/// A decision that a search carried out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decided {
    /// The last number that it took; it took all after the decision before.
    pub(super) last: u32,
    pub(super) flaw: Flaw,
    pub(super) decision: Decision,
}

/// Tells of a database.
pub(super) struct Teller<'a> {
    pub(super) database: &'a Database,
    problem: &'a Problem,
    decided: &'a [Decided],
    /// What a token was that is gone since.
    gone: &'a str,
}

/// Whose a constraint is, in words.
pub(super) struct Because {
    pub(super) phrase: String,
    pub(super) place: String,
    pub(super) tokens: Vec<ToldToken>,
}

/// A goal as an explanation names it.
pub(super) fn told_goal(problem: &Problem, goal: usize) -> ToldGoal {
    let goal = &problem.goals[goal];
    ToldGoal {
        name: goal.name.clone(),
        mandatory: goal.weight.is_none(),
        place: in_problem(problem, goal.position),
    }
}

fn in_problem(problem: &Problem, position: Position) -> String {
    let file = problem.files.get(position.file as usize);
    match (position.line, file) {
        (0, _) => String::new(),
        (_, Some(file)) => format!("{file}:{position}"),
        (_, None) => position.to_string(),
    }
}

impl<'a> Teller<'a> {
    pub(super) fn new(
        database: &'a Database,
        problem: &'a Problem,
        decided: &'a [Decided],
        gone: &'a str,
    ) -> Self {
        Teller {
            database,
            problem,
            decided,
            gone,
        }
    }

    pub(super) fn in_model(&self, position: Position) -> String {
        match position.line {
            0 => String::new(),
            _ => self.database.model().place(position),
        }
    }

    /// A token with all that is known of it; none if it is gone.
    pub(super) fn token(&self, token: TokenId) -> Option<ToldToken> {
        let at = self.database.token(token)?;
        let model = self.database.model();
        let parameters = at.parameters.iter();
        let values: Vec<_> = parameters.map(|&one| self.database.value(one)).collect();
        let (start, end) = (self.database.start(token), self.database.finish(token));
        // Names of arguments are as in plans.
        let timeline = at.timeline.unwrap_or(0);
        let times = [start.min, end.min];
        let named = PlanToken::new(model, 0, (timeline, at.predicate), &values, times);
        let (why, place) = self.cause(at.cause);
        Some(ToldToken {
            predicate: named.predicate,
            arguments: named.arguments,
            timeline: at.timeline.map(|at| model.timelines[at].name.clone()),
            start: [start.min, start.max],
            end: [end.min, end.max],
            why,
            place,
        })
    }

    fn cause(&self, cause: Cause) -> (String, String) {
        match cause {
            Cause::Goal(goal) => {
                let goal = &self.problem.goals[goal];
                let kind = match goal.weight {
                    None => "mandatory goal",
                    Some(_) => "goal",
                };
                let place = in_problem(self.problem, goal.position);
                (format!("{kind} {}", goal.name), place)
            }
            Cause::Fact(fact) => {
                let position = self.problem.facts[fact].position;
                ("it is the case".into(), in_problem(self.problem, position))
            }
            Cause::Rule { rule, master } => {
                let place = self.in_model(self.database.model().rules[rule].position);
                (
                    format!("a rule of {} asks for it", self.name(master)),
                    place,
                )
            }
            Cause::Filler => ("nothing else is said then".into(), String::new()),
            Cause::User => ("the user put it there".into(), String::new()),
        }
    }

    /// A token's short name: that of the goal that it is, or what it says.
    pub(super) fn name(&self, token: TokenId) -> String {
        let Some(at) = self.database.token(token) else {
            return self.gone.to_owned();
        };
        match at.cause {
            Cause::Goal(goal) => self.problem.goals[goal].name.clone(),
            _ => self
                .token(token)
                .map_or_else(String::new, |one| one.to_string()),
        }
    }

    /// Whose a constraint is.
    pub(super) fn because(&self, owner: Owner) -> Because {
        let model = self.database.model();
        let (phrase, place, tokens) = match owner {
            Owner::Token(token) => {
                let (phrase, place) = match self.database.token(token).map(|at| at.cause) {
                    Some(cause @ (Cause::Goal(_) | Cause::Fact(_))) => self.cause(cause),
                    Some(_) => ("what it is itself".to_owned(), String::new()),
                    None => (self.gone.to_owned(), String::new()),
                };
                (phrase, place, vec![token])
            }
            Owner::Rule {
                master,
                rule,
                relation,
            } => {
                let position = match relation {
                    Some(relation) => self.database.position_of(rule, relation),
                    None => model.rules[rule].position,
                };
                let phrase = format!("a rule of {}", self.name(master));
                (phrase, self.in_model(position), vec![master])
            }
            Owner::Sequence { first, second } => {
                let timeline = self.database.token(first).and_then(|at| at.timeline);
                let timeline = timeline.map_or("a timeline", |at| &model.timelines[at].name);
                let phrase = format!("one after the other on {timeline}");
                (phrase, String::new(), vec![first, second])
            }
            Owner::Merge(token) => {
                let phrase = format!("one token for {} and another", self.name(token));
                (phrase, String::new(), vec![token])
            }
            Owner::Order(order) => {
                let place = in_problem(self.problem, self.problem.orders[order].position);
                ("an order of goals".to_owned(), place, Vec::new())
            }
            Owner::Decision(number) => self.decision(number),
            Owner::Given => ("what the problem gives".into(), String::new(), Vec::new()),
            Owner::Past => ("the past".into(), String::new(), Vec::new()),
        };
        Because {
            phrase,
            place,
            tokens: tokens.iter().filter_map(|&at| self.token(at)).collect(),
        }
    }

    fn decision(&self, number: u32) -> (String, String, Vec<TokenId>) {
        let place = self.decided.partition_point(|at| at.last < number);
        let Some(decided) = self.decided.get(place) else {
            return ("a decision of the search".into(), String::new(), Vec::new());
        };
        let resource = match decided.flaw {
            Flaw::OverUse { resource, .. } => Some(&self.database.model().resources[resource]),
            _ => None,
        };
        let position = resource.map_or(String::new(), |at| self.in_model(at.position));
        let name = resource.map_or("", |at| &at.name);
        match decided.decision {
            Decision::Order(..) if number < decided.last => {
                let phrase = "the contrary was tried before, and led to no plan".to_owned();
                (phrase, position, Vec::new())
            }
            Decision::Order(order, _) => {
                let phrase = format!("there is not enough of {name} for both at once");
                (phrase, position, vec![order.from.0, order.to.0])
            }
            Decision::Wait { token, .. } => {
                let phrase = format!("there is not enough of {name} before");
                (phrase, position, vec![token])
            }
            Decision::Close => {
                let phrase = "a timeline of states leaves no time without a token".to_owned();
                (phrase, String::new(), Vec::new())
            }
            _ => ("a decision of the search".into(), String::new(), Vec::new()),
        }
    }

    /// What a refusal says.
    pub(super) fn conflict(&self, conflict: &Conflict) -> Reason {
        let one = |kind, message: String, owner| {
            let because = self.because(owner);
            let part = Part {
                message: because.phrase,
                place: because.place,
                amount: None,
                tokens: because.tokens,
            };
            reason(kind, message, vec![part])
        };
        match conflict {
            Conflict::Times(cycle) => self.cycle(cycle),
            Conflict::Values(refusal) => self.values(refusal),
            Conflict::Known {
                owner,
                is,
                expected,
            } => {
                let message = format!("two known times are {is} ticks apart, not {expected:?}");
                one(ReasonKind::Times, message, *owner)
            }
            Conflict::Amount { owner } => {
                let message = "amounts of a resource are beyond what can be counted".to_owned();
                one(ReasonKind::Amount, message, *owner)
            }
            Conflict::Mismatch { owner } => {
                let message = "a token is not what is asked for".to_owned();
                one(ReasonKind::Mismatch, message, *owner)
            }
        }
    }

    fn cycle(&self, conflict: &temporal::Conflict<Owner>) -> Reason {
        let excess = conflict.excess();
        let ticks = if excess == 1 { "tick" } else { "ticks" };
        let message = format!("these times cannot all be, by {excess} {ticks}");
        let moments = self.moments();
        let parts = conflict.cycle.iter().map(|link| {
            let sentence = self.link(&moments, link);
            match link.owner {
                None => Part {
                    message: sentence,
                    place: String::new(),
                    amount: None,
                    tokens: Vec::new(),
                },
                Some(owner) => {
                    let because = self.because(owner);
                    Part {
                        message: format!("{sentence}: {}", because.phrase),
                        place: because.place,
                        amount: None,
                        tokens: because.tokens,
                    }
                }
            }
        });
        let mut told = reason(ReasonKind::Times, message, parts.collect());
        told.amount = Some(excess);
        told
    }

    /// By the place of a point: the end of the token that it is.
    fn moments(&self) -> Vec<Option<(Point, TokenId, End)>> {
        let mut moments = Vec::new();
        for (token, at) in self.database.tokens() {
            for (time, end) in [(at.start, End::Start), (at.finish, End::Finish)] {
                if let Time::Point(point) = time {
                    if moments.len() <= point.index() {
                        moments.resize(point.index() + 1, None);
                    }
                    // A goal that is merged has the other token's times, and is told first.
                    moments[point.index()].get_or_insert((point, token, end));
                }
            }
        }
        moments
    }

    fn link(
        &self,
        moments: &[Option<(Point, TokenId, End)>],
        link: &temporal::Link<Owner>,
    ) -> String {
        let origin = self.database.network().origin();
        let least = link.at_least;
        if link.owner.is_none() {
            let horizon = self.database.horizon();
            return match link.from == origin {
                true => format!("the horizon begins at {}", horizon.min),
                false => format!("the horizon ends at {}", horizon.max),
            };
        }
        let moment = |point: Point| {
            let found = moments.get(point.index()).copied().flatten();
            found.filter(|at| at.0 == point).map(|at| (at.1, at.2))
        };
        let (from, to) = (moment(link.from), moment(link.to));
        let end = |at: Option<(TokenId, End)>| match at {
            Some((token, End::Start)) => format!("{} starts", self.name(token)),
            Some((token, End::Finish)) => format!("{} ends", self.name(token)),
            None => format!("{} is", self.gone),
        };
        if link.from == origin {
            return format!("{} at {least} or later", end(to));
        }
        if link.to == origin {
            return format!("{} at {} or earlier", end(from), -least);
        }
        match (from, to) {
            (Some((one, End::Start)), Some((other, End::Finish))) if one == other => {
                format!("{} lasts {least} or more", self.name(one))
            }
            (Some((one, End::Finish)), Some((other, End::Start))) if one == other => {
                format!("{} lasts at most {}", self.name(one), -least)
            }
            _ if least == 0 => format!("{} no earlier than {}", end(to), end(from)),
            _ if least > 0 => format!("{} {least} or more after {}", end(to), end(from)),
            _ => format!("{} at most {} after {}", end(from), -least, end(to)),
        }
    }

    /// What an over-use is, and by whom.
    pub(super) fn over_use(&self, resource: ResourceId, over_use: &OverUse<Owner>) -> Reason {
        let of = &self.database.model().resources[resource];
        let (name, tick, amount) = (&of.name, over_use.worst_tick, over_use.amount);
        let message = match (over_use.bound, of.kind) {
            (Bound::Most, _) => format!(
                "{name} rises {amount} above its greatest level {} at tick {tick}",
                of.limits.max
            ),
            (Bound::Least, ResourceKind::Depletable) => format!(
                "{name} falls {amount} below its least level {} at tick {tick}",
                of.limits.min
            ),
            (Bound::Least, _) => {
                format!("{name} lacks {amount} for what is to use it at tick {tick}")
            }
        };
        let parts = over_use.contributors.iter().map(|one| {
            let does = match over_use.bound {
                Bound::Least => "takes",
                Bound::Most => "gives",
            };
            let because = self.because(one.owner);
            let (who, place) = match one.owner {
                Owner::Rule { master, rule, .. } => {
                    let effects = &self.database.model().rules[rule].effects;
                    let mut of = effects.iter().filter(|at| at.resources.contains(&resource));
                    let place = of.next().map(|at| self.in_model(at.position));
                    (self.name(master), place.unwrap_or(because.place))
                }
                _ => (because.phrase, because.place),
            };
            Part {
                message: format!("{who} {does} {}", one.amount),
                place,
                amount: Some(one.amount),
                tokens: because.tokens,
            }
        });
        let last = (over_use.during.max != Ticks::MAX).then_some(over_use.during.max);
        Reason {
            place: self.in_model(of.position),
            times: Some((over_use.during.min, last)),
            amount: Some(amount),
            ..reason(ReasonKind::OverUse, message, parts.collect())
        }
    }

    /// What is missing, and has no decision that puts it right.
    pub(super) fn flaw(
        database: &'a mut Database,
        problem: &'a Problem,
        decided: &'a [Decided],
        flaw: Flaw,
    ) -> Reason {
        if let Flaw::OverUse {
            resource, bound, ..
        } = flaw
        {
            let earliest = &database.levels(resource).earliest;
            let over_use = earliest.first_over_use_of(bound, Ticks::MIN);
            let teller = Teller::new(database, problem, decided, "");
            if let Some(over_use) = over_use {
                return teller.over_use(resource, &over_use);
            }
        }
        Teller::new(database, problem, decided, "a token that is gone").missing(flaw)
    }

    fn missing(&self, flaw: Flaw) -> Reason {
        let model = self.database.model();
        match flaw {
            Flaw::Open(open) => self.open(open),
            Flaw::Goal(token) => {
                let message = format!("{} has no place", self.name(token));
                self.of_token(message, token)
            }
            Flaw::Unbound { token, parameter } => {
                let at = self.token(token);
                let name = at.and_then(|at| at.arguments.get(parameter).map(|at| at.0.clone()));
                let name = name.unwrap_or_default();
                let message = format!("{name} of {} has no value that can be", self.name(token));
                self.of_token(message, token)
            }
            Flaw::Gap { timeline, after } => {
                let name = &model.timelines[timeline].name;
                match after {
                    None => {
                        let message = format!("{name} has no token when the horizon begins");
                        reason(ReasonKind::Missing, message, Vec::new())
                    }
                    Some(token) => {
                        let message = format!("{name} has no token after {}", self.name(token));
                        self.of_token(message, token)
                    }
                }
            }
            Flaw::OverUse { resource, .. } => {
                let message = format!("{} is over-used", model.resources[resource].name);
                reason(ReasonKind::OverUse, message, Vec::new())
            }
        }
    }

    fn of_token(&self, message: String, token: TokenId) -> Reason {
        let told = self.token(token);
        let parts = told.map(|told| Part {
            message: format!("{told}: {}", told.why),
            place: told.place.clone(),
            amount: None,
            tokens: vec![told],
        });
        reason(ReasonKind::Missing, message, parts.into_iter().collect())
    }

    /// What a rule asks for.
    fn open(&self, Open { instance, step }: Open) -> Reason {
        let model = self.database.model();
        let Some(at) = self.database.instance(instance) else {
            return reason(ReasonKind::Missing, self.gone.to_owned(), Vec::new());
        };
        let (master, rule) = (self.name(at.master), &model.rules[at.rule]);
        let (message, position) = match step {
            Step::Choice(_) => {
                let message = format!("{master} needs one of several, and none can be");
                (message, rule.position)
            }
            Step::Relation(relation) => {
                let said = self.database.relation(instance, relation);
                let asked = match &said.target {
                    Target::New(pattern, _) => {
                        let wishes = self.database.wishes(instance, relation);
                        let parameters = &model.predicates[pattern.predicate].parameters;
                        let values = parameters.iter().zip(&wishes).map(|(parameter, wish)| {
                            let value = wish.and_then(|wish| self.database.value(wish));
                            value.map_or("?".to_owned(), |value| model.show(parameter.of, value))
                        });
                        let values: Vec<String> = values.collect();
                        let timelines = pattern.timelines.iter();
                        let timelines: Vec<&str> = timelines
                            .map(|&at| model.timelines[at].name.as_str())
                            .collect();
                        let predicate = &model.predicates[pattern.predicate].name;
                        format!(
                            "{predicate}({}) on {}",
                            values.join(", "),
                            timelines.join(" or ")
                        )
                    }
                    Target::Label(_) => "two of its tokens in order".to_owned(),
                };
                let relation = snake(&format!("{:?}", said.kind));
                let there = if said.condition { " to be there" } else { "" };
                let message = format!("{master} needs {asked}{there} ({relation})");
                (message, said.position)
            }
        };
        let place = self.in_model(position);
        let mut told = self.of_token(message, at.master);
        told.place = place;
        told
    }
}

pub(super) fn reason(kind: ReasonKind, message: String, parts: Vec<Part>) -> Reason {
    Reason {
        kind,
        message,
        place: String::new(),
        times: None,
        amount: None,
        parts,
    }
}

/// A name of the code as the language writes it.
fn snake(name: &str) -> String {
    let mut out = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.extend(letter.to_lowercase());
    }
    out
}

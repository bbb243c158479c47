//! Which other tokens a rule asks for: relations, their alternatives, and decompositions.

use super::Scope;
use super::rule::Draft;
use crate::language::tree::{Form, Kind};
use crate::model::{Body, Bound, Distance, End, Profile, Relation, RelationKind, Target};

const RELATIONS: [(&str, RelationKind); 13] = [
    ("meets", RelationKind::Meets),
    ("met_by", RelationKind::MetBy),
    ("before", RelationKind::Before),
    ("after", RelationKind::After),
    ("starts", RelationKind::Starts),
    ("ends", RelationKind::Ends),
    ("equals", RelationKind::Equals),
    ("contains", RelationKind::Contains),
    ("contained_by", RelationKind::ContainedBy),
    ("starts_during", RelationKind::StartsDuring),
    ("starts_before", RelationKind::StartsBefore),
    ("ends_during", RelationKind::EndsDuring),
    ("ends_after", RelationKind::EndsAfter),
];

/// What `temporaldistance` is written as.
const A_DISTANCE: &str = "(temporaldistance (start) [0 10] (end label))";

/// The relation of a word.
pub(super) fn relation_kind(word: &str) -> Option<RelationKind> {
    let known = RELATIONS.iter().find(|(name, _)| *name == word);
    known.map(|(_, kind)| *kind)
}

/// The words of all relations.
pub(super) fn relation_words() -> impl Iterator<Item = &'static str> {
    let words = RELATIONS.iter().map(|(name, _)| *name);
    words.chain(["temporaldistance"])
}

impl<'t> Scope<'t, '_> {
    /// `(AND …)`, `(OR …)` or a relation.
    pub(super) fn body(&mut self, form: Form<'t>, draft: &mut Draft<'t>) -> Option<Body> {
        match form.head() {
            Some("AND") => {
                let parts = form.children().skip(1);
                Some(Body::All(
                    parts.filter_map(|part| self.body(part, draft)).collect(),
                ))
            }
            Some("OR") => {
                Some(self.alternatives(form, draft, |scope, part, draft| scope.body(part, draft)))
            }
            Some("temporaldistance") => self.distance(form, draft),
            Some(word) => match relation_kind(word) {
                Some(kind) => self.relation(form, kind, draft),
                None => {
                    let known = relation_words().chain(["AND", "OR"]);
                    let head = form.children().next().unwrap_or(form);
                    self.notes.unknown(head, "AND, OR or a relation", known);
                    None
                }
            },
            None => {
                self.notes
                    .error(form, "AND, OR or a relation, in parentheses");
                None
            }
        }
    }

    /// `(kind [bounds] :condition anchor target)`, of which only the target must be there.
    fn relation(
        &mut self,
        form: Form<'t>,
        kind: RelationKind,
        draft: &mut Draft<'t>,
    ) -> Option<Body> {
        let (mut bounds, mut words, mut flag) = (Vec::new(), Vec::new(), None);
        for part in form.children().skip(1) {
            match part.kind() {
                Kind::Span => bounds.push(part),
                Kind::Keyword if flag.is_none() => flag = Some(part),
                _ => words.push(part),
            }
        }
        let most = kind.distances(&[]).len();
        if let Some(more) = bounds.get(most) {
            let expected = format!("at most {most} bounds of {}", form.head().unwrap_or(""));
            self.notes.error(*more, expected);
            return None;
        }
        let bounds: Option<Vec<[Bound; 2]>> = bounds
            .into_iter()
            .map(|form| self.bounds(form, Some(0), &mut draft.variables))
            .collect();
        let (anchor, target) = match *words.as_slice() {
            [target] => (0, target),
            [anchor, target] => (self.label(anchor, draft)?, target),
            _ => {
                let expected = "bounds, the label of a token and the token that is asked for";
                self.notes.error(form, expected);
                return None;
            }
        };
        // An executive does not plan the past: what comes before is there or not.
        let past = matches!(kind, RelationKind::MetBy | RelationKind::ContainedBy)
            && self.model.profile == Profile::Executive;
        let condition = self.condition(flag, past);
        let target = self.target(target, draft)?;
        let (position, distances) = (form.position(), kind.distances(&bounds?));
        let relation = Relation {
            position,
            kind,
            anchor,
            target,
            distances,
            condition,
        };
        Some(Body::Relation(Box::new(relation)))
    }

    /// Whether a relation is a condition, as its option says or as is usual.
    fn condition(&mut self, flag: Option<Form<'t>>, usual: bool) -> bool {
        match flag.map(|flag| (flag, flag.word())) {
            None => usual,
            Some((_, ":condition")) => true,
            Some((_, ":insert")) => false,
            Some((flag, _)) => {
                let known = [":condition", ":insert"];
                self.notes
                    .unknown(flag, ":condition or :insert", known.into_iter());
                usual
            }
        }
    }

    /// `(temporaldistance (start) [min max] (end label))`.
    fn distance(&mut self, form: Form<'t>, draft: &mut Draft<'t>) -> Option<Body> {
        let parts: Vec<Form> = form.children().skip(1).collect();
        let (from, bounds, to, flag) = match *parts.as_slice() {
            [from, bounds, to] => (from, bounds, to, None),
            [flag, from, bounds, to] if flag.kind() == Kind::Keyword => {
                (from, bounds, to, Some(flag))
            }
            _ => {
                self.notes.error(form, A_DISTANCE);
                return None;
            }
        };
        let (from, anchor) = self.end(from)?;
        let (to, target) = self.end(to)?;
        let anchor = match anchor {
            Some(label) => self.label(label, draft)?,
            None => 0,
        };
        let Some(target) = target else {
            self.notes.error(form, A_DISTANCE);
            return None;
        };
        let [min, max] = self.bounds(bounds, None, &mut draft.variables)?;
        let condition = self.condition(flag, false);
        let target = self.target(target, draft)?;
        let distances = vec![Distance {
            from,
            to,
            min,
            max,
            backward: false,
        }];
        let (position, kind) = (form.position(), RelationKind::Distance);
        let relation = Relation {
            position,
            kind,
            anchor,
            target,
            distances,
            condition,
        };
        Some(Body::Relation(Box::new(relation)))
    }

    /// `(start label)` or `(end label)`, or without a label.
    fn end(&mut self, form: Form<'t>) -> Option<(End, Option<Form<'t>>)> {
        let mut parts = form.children().skip(1);
        let (label, more) = (parts.next(), parts.next());
        let end = match form.head().filter(|_| more.is_none()) {
            Some("start") => End::Start,
            Some("end") => End::Finish,
            _ => {
                self.notes.error(form, "(start label) or (end label)");
                return None;
            }
        };
        Some((end, label))
    }

    /// The number of a token that the text has named before; 0 for `master`.
    pub(super) fn label(&mut self, form: Form<'t>, draft: &Draft<'t>) -> Option<usize> {
        let label = draft.labels.get(form.word()).copied();
        if label.is_none() {
            let known = draft.labels.keys().copied();
            self.notes
                .unknown(form, "the label of a token, given before", known);
        }
        label
    }

    /// `(SINGLE …)`, `(LABEL name (SINGLE …))` or the label of a token.
    fn target(&mut self, form: Form<'t>, draft: &mut Draft<'t>) -> Option<Target> {
        if form.symbol().is_some() {
            return self.label(form, draft).map(Target::Label);
        }
        let mut parts = form.children().skip(1);
        let (name, single) = match form.head() {
            Some("LABEL") => match (parts.next(), parts.next(), parts.next()) {
                (Some(name), Some(single), None) if name.symbol().is_some() => (Some(name), single),
                _ => {
                    self.notes.error(form, "(LABEL name (SINGLE …))");
                    return None;
                }
            },
            _ => (None, form),
        };
        let found = self.pattern(single, &mut draft.variables, &draft.master)?;
        let label = draft.rule.labels;
        draft.rule.labels += 1;
        draft.same_timelines.push(found.same);
        if let Some(name) = name {
            if draft.labels.contains_key(name.word()) {
                self.notes.error(name, "a label that is not given yet");
                return None;
            }
            draft.labels.insert(name.word(), label);
            draft.labelled.push(name.word());
        }
        Some(Target::New(found.pattern, label))
    }

    /// `(seq …)`, `(par …)`, a token, or an `OR` of them: tokens within the master.
    pub(super) fn decomposition(&mut self, form: Form<'t>, draft: &mut Draft<'t>) -> Option<Body> {
        if !form.is_form("OR") {
            return self.one_decomposition(form, draft);
        }
        let read =
            |scope: &mut Self, part, draft: &mut Draft<'t>| scope.one_decomposition(part, draft);
        Some(self.alternatives(form, draft, read))
    }

    /// The alternatives of an `OR`. A label that one of them gives is known within it alone.
    fn alternatives(
        &mut self,
        form: Form<'t>,
        draft: &mut Draft<'t>,
        read: impl Fn(&mut Self, Form<'t>, &mut Draft<'t>) -> Option<Body>,
    ) -> Body {
        let mut parts = Vec::new();
        for part in form.children().skip(1) {
            let known = draft.labelled.len();
            parts.extend(read(self, part, draft));
            for name in draft.labelled.drain(known..) {
                draft.labels.remove(name);
            }
        }
        if form.children().nth(1).is_none() {
            self.notes.error(form, "one alternative or more in OR");
        }
        Body::Any(parts, form.position())
    }

    fn one_decomposition(&mut self, form: Form<'t>, draft: &mut Draft<'t>) -> Option<Body> {
        let mut relations = Vec::new();
        self.part(form, draft, &mut relations)?;
        Some(Body::All(relations))
    }

    /// A part of a decomposition: the labels that come first in it, and those that come last.
    fn part(
        &mut self,
        form: Form<'t>,
        draft: &mut Draft<'t>,
        relations: &mut Vec<Body>,
    ) -> Option<(Vec<usize>, Vec<usize>)> {
        let head = form.head();
        if !matches!(head, Some("seq" | "par")) {
            let label = match self.target(form, draft)? {
                Target::New(pattern, label) => {
                    let kind = RelationKind::Contains;
                    relations.push(Body::Relation(Box::new(Relation {
                        position: form.position(),
                        kind,
                        anchor: 0,
                        target: Target::New(pattern, label),
                        distances: kind.distances(&[]),
                        condition: false,
                    })));
                    label
                }
                Target::Label(_) => {
                    self.notes.error(form, "seq, par, or a token");
                    return None;
                }
            };
            return Some((vec![label], vec![label]));
        }
        let mut parts = form.children().skip(1).peekable();
        let bounds = parts.next_if(|part| part.kind() == Kind::Span);
        let bounds = match bounds {
            Some(bounds) => self.bounds(bounds, Some(0), &mut draft.variables)?,
            None => [Bound::Value(0), Bound::None],
        };
        let (mut firsts, mut lasts) = (Vec::new(), Vec::new());
        for part in parts {
            let (mut first, mut last) = self.part(part, draft, relations)?;
            if head == Some("par") {
                firsts.append(&mut first);
                lasts.append(&mut last);
                continue;
            }
            if lasts.is_empty() {
                firsts.clone_from(&first);
            }
            self.follow(&lasts, &first, bounds, part, relations)?;
            lasts = last;
        }
        if lasts.is_empty() {
            self.notes.error(form, "one token or more");
            return None;
        }
        Some((firsts, lasts))
    }

    /// That some tokens end before others start.
    fn follow(
        &mut self,
        lasts: &[usize],
        firsts: &[usize],
        bounds: [Bound; 2],
        part: Form<'t>,
        relations: &mut Vec<Body>,
    ) -> Option<()> {
        const MOST_PAIRS: usize = 10_000;
        if lasts.len() * firsts.len() > MOST_PAIRS {
            self.notes.error(
                part,
                format!("at most {MOST_PAIRS} pairs of tokens to order"),
            );
            return None;
        }
        let kind = RelationKind::Before;
        for &anchor in lasts {
            for &label in firsts {
                relations.push(Body::Relation(Box::new(Relation {
                    position: part.position(),
                    kind,
                    anchor,
                    target: Target::Label(label),
                    distances: kind.distances(&[bounds]),
                    condition: false,
                })));
            }
        }
        Some(())
    }
}

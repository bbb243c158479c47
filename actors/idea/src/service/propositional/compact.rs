//! Only what counts later is kept between cycles: present tokens, the ones before them, and what
//! their rules still ask for.

use smallvec::SmallVec;

use super::search::{Place, World};
use super::state::{Bounds, Cell, Finish, Guard, Instance, Known, Open, State, Token};

/// New places of what is kept.
struct Places {
    cells: Vec<Option<Cell>>,
    finishes: Vec<Option<Finish>>,
    tokens: Vec<Option<Token>>,
}

impl World {
    /// Drops what does not count any more, and gives the rest new places: of each timeline the last
    /// tokens, as many as count.
    pub(in crate::service) fn compact(&mut self, known: usize) {
        let mut old = std::mem::take(&mut self.state);
        let mut new = State {
            operations: old.operations,
            tick: old.tick,
            exact: old.exact,
            loose: old.loose.clone(),
            formulas: std::mem::take(&mut old.formulas),
            ..State::default()
        };
        let mut places = Places {
            cells: vec![None; old.cells.len()],
            finishes: vec![None; old.finishes.len()],
            tokens: vec![None; old.tokens.len()],
        };
        let mut kept: Vec<Token> = Vec::with_capacity(2 * old.lanes.len());
        for lane in &old.lanes {
            let first = lane.tokens.len().saturating_sub(known);
            let mut tokens: SmallVec<[Token; 3]> = SmallVec::new();
            for &token in &lane.tokens[first..] {
                places.tokens[usize::from(token)] = Some(kept.len() as Token);
                tokens.push(kept.len() as Token);
                kept.push(token);
            }
            let mut lane = lane.clone();
            lane.tokens = tokens;
            new.lanes.push(lane);
        }
        let mut open: Vec<Open> = Vec::with_capacity(old.open.len());
        open.extend(&old.open);
        for &token in &kept {
            let at = old.at(token);
            let present = old.last(at.timeline) == Some(token);
            let mut is = at.clone();
            is.finish = places.finish(&old, &mut new, at.finish);
            for cell in &mut is.parameters {
                *cell = places.cell(&old, &mut new, *cell);
            }
            is.instances.clear();
            for (instance, said) in (0..).zip(&at.instances) {
                let asks = |at: &&mut Open| (at.token, at.instance) == (token, instance);
                let waits = present && said.guard != Guard::Void;
                let mine = open.iter_mut().filter(asks);
                let mut asked = false;
                for at in mine {
                    at.instance = is.instances.len() as u16;
                    at.token = places.tokens[usize::from(token)].expect("it is kept") | KEPT;
                    asked = true;
                }
                if waits || asked {
                    let said = places.instance(&old, &mut new, said);
                    is.instances.push(said);
                }
            }
            new.tokens.push(is);
        }
        open.retain(|at| at.token & KEPT != 0);
        open.iter_mut().for_each(|at| at.token &= !KEPT);
        new.open = open;
        for gap in &old.gaps {
            let ends = [gap.from, gap.to].map(|at| places.finishes[usize::from(old.end(at))]);
            let [Some(from), Some(to)] = ends else {
                continue;
            };
            let is_known = |at: Finish| {
                let Bounds { min, max, .. } = new.finishes[usize::from(at)];
                min == max
            };
            if !is_known(from) || !is_known(to) {
                let gap = gap.clone();
                new.gaps.push(super::state::Gap { from, to, ..gap });
            }
        }
        for plan in self.plans.iter_mut().flatten() {
            if let Place::At(_, token) = &mut plan.place
                && let Some(now) = places.tokens[usize::from(*token)]
            {
                *token = now;
            }
        }
        self.state = new;
    }
}

/// Marks a place that is a new one.
const KEPT: Token = 1 << 15;

impl Places {
    fn cell(&mut self, old: &State, new: &mut State, cell: Cell) -> Cell {
        let root = old.root(cell);
        *self.cells[usize::from(root)].get_or_insert_with(|| {
            let known = &old.cells[usize::from(root)];
            new.cells.push(Known {
                same: None,
                ..known.clone()
            });
            (new.cells.len() - 1) as Cell
        })
    }

    fn finish(&mut self, old: &State, new: &mut State, finish: Finish) -> Finish {
        let root = old.end(finish);
        *self.finishes[usize::from(root)].get_or_insert_with(|| {
            new.finishes.push(old.finishes[usize::from(root)].clone());
            (new.finishes.len() - 1) as Finish
        })
    }

    fn instance(&mut self, old: &State, new: &mut State, said: &Instance) -> Instance {
        let cell = |at: &Option<Cell>| at.map(|at| self.cell(old, new, at));
        let variables = said.variables.iter().map(cell).collect();
        let token = |at: &Option<Token>| at.and_then(|at| self.tokens[usize::from(at)]);
        Instance {
            rule: said.rule,
            guard: said.guard,
            variables,
            labels: said.labels.iter().map(token).collect(),
        }
    }
}

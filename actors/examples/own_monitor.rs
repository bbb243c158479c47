//! Two carts on a single track, watched by the library's monitors: which of them collide,
//! and which wait for each other for ever. The carts know nothing of the monitors: they record
//! where they are, and what they wait for.
//!
//! ```text
//! 0 --- 1 --- 2 --- 3 --- 4
//! ```
//!
//! `cargo run -p farside-actors --example own_monitor`

use farside::prelude::*;
use farside_actors::invariants::{CollisionMonitor, DeadlockMonitor, Place, Seen, Waits};
use serde::{Deserialize, Serialize};

/// What a cart records of itself at each change.
#[derive(Serialize, Deserialize, Clone)]
struct CartState {
    at: u32,
    /// Where it drives to right now.
    towards: Option<u32>,
    /// Where it would drive to, and sees another cart.
    blocked_by: Option<u32>,
    arrived: bool,
}

/// A cart with a goal. A careful one looks before it drives on.
struct Cart {
    state: CartState,
    goal: u32,
    careful: bool,
    others: Vec<String>,
    /// Where it last heard the others to be.
    heard: Vec<(String, u32)>,
}

/// To the others: I am here.
#[derive(Serialize, Deserialize)]
struct Here {
    name: String,
    at: u32,
}

/// Timer: look, and drive on.
#[derive(Serialize, Deserialize)]
struct Look;

/// Timer: the next place is reached.
#[derive(Serialize, Deserialize)]
struct Reached;

impl Cart {
    fn tell(&self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.sample(&self.state);
        for other in &self.others {
            let (name, at) = (ctx.name().to_owned(), self.state.at);
            let other = ctx.lookup::<Cart>(other)?;
            ctx.send(other, Here { name, at });
        }
        Ok(())
    }
}

impl Actor for Cart {
    type Accepts = (Here, Look, Reached);

    fn started(&mut self, ctx: &mut Context<'_, Self>) -> Outcome {
        ctx.timer(SimDuration::from_secs(1), Look);
        self.tell(ctx)
    }
}

impl Handler<Here> for Cart {
    fn handle(&mut self, here: Here, _ctx: &mut Context<'_, Self>) -> Outcome {
        self.heard.retain(|(name, _)| *name != here.name);
        self.heard.push((here.name, here.at));
        Ok(())
    }
}

impl Handler<Look> for Cart {
    fn handle(&mut self, _look: Look, ctx: &mut Context<'_, Self>) -> Outcome {
        let at = self.state.at;
        let next = if at < self.goal { at + 1 } else { at - 1 };
        let taken = self.heard.iter().any(|(_, place)| *place == next);
        if self.careful && taken {
            self.state.blocked_by = Some(next);
            ctx.sample(&self.state);
            ctx.timer(SimDuration::from_secs(1), Look);
            return Ok(());
        }
        (self.state.towards, self.state.blocked_by) = (Some(next), None);
        ctx.timer(SimDuration::from_secs(4), Reached);
        self.tell(ctx)
    }
}

impl Handler<Reached> for Cart {
    fn handle(&mut self, _reached: Reached, ctx: &mut Context<'_, Self>) -> Outcome {
        if let Some(next) = self.state.towards.take() {
            self.state.at = next;
        }
        self.state.arrived = self.state.at == self.goal;
        if !self.state.arrived {
            ctx.timer(SimDuration::from_secs(1), Look);
        }
        self.tell(ctx)
    }
}

/// Two carts that want to get past each other.
fn run(careful: bool) {
    let mut sim = Simulation::new(1);
    let carts = [("cart_a", 0, 4), ("cart_b", 3, 0)];
    let mut hosts = Vec::new();
    for (name, at, goal) in carts {
        let host = sim.host(name);
        hosts.push((host, name));
        let others = carts
            .iter()
            .map(|cart| cart.0)
            .filter(|other| *other != name);
        let others: Vec<String> = others.map(str::to_owned).collect();
        sim.actor(host, name, move |_| Cart {
            state: CartState {
                at,
                towards: None,
                blocked_by: None,
                arrived: false,
            },
            goal,
            careful,
            others: others.clone(),
            heard: Vec::new(),
        });
    }
    for &(from, a) in &hosts {
        for &(to, b) in hosts.iter().filter(|(to, _)| *to != from) {
            let link = FixedDelay::new(SimDuration::from_millis(20));
            sim.link(from, to, &format!("{a}-{b}"), link);
        }
    }

    // All that the library has to be told of carts.
    let place = |cart: &CartState| match cart.towards {
        Some(next) => Place::Between(cart.at, next),
        None => Place::At(cart.at),
    };
    let (monitor, collisions) = CollisionMonitor::new(move |_, cart: &CartState| place(cart));
    sim.observe(monitor);
    let window = SimDuration::from_secs(30);
    let (monitor, deadlocks) = DeadlockMonitor::new(window, move |_, cart: &CartState| Seen {
        place: place(cart),
        waits: cart.blocked_by.map_or(Waits::ForNobody, Waits::ForVertex),
        done: cart.arrived,
    });
    sim.observe(monitor.that_stops());

    let report = sim.run(Executor::Inline).expect("the carts can start");
    println!("careful: {careful}; the run {}", report.end.name());
    for collision in collisions.get().named() {
        println!("  collision: {collision}");
    }
    for deadlock in deadlocks.get() {
        println!("  {deadlock}");
    }
    assert_eq!(collisions.get().count() > 0, !careful);
    assert_eq!(deadlocks.get().len(), usize::from(careful));
}

fn main() {
    // Those that do not look collide; those that do stand face to face for ever.
    run(false);
    run(true);
}

//! The network-guided system, as scenarios see it: `[world]`, `[team]`, `[network]`.

use std::sync::Arc;

use farside::{Pattern, Report};
use farside_actors::figure::Figure;
use farside_actors::system::settings::Table;
use farside_actors::system::{
    Account, Assembly, Builtin, Goal, Invariant, Metric, PictureError, PictureInfo, PictureRequest,
    Recording, Removable, Renamed, Results, Section, Settings, Setup, SetupError, System,
};
use farside_worlds::SensorNetwork;
use serde::Deserialize;
use serde_json::Value;

use crate::account;
use crate::error::blame;
use crate::ids;
use crate::place::Place;
use crate::scenario::NetworkScenario;
use crate::scene::NetworkScene;
use crate::world::in_crater;
use crate::{
    CompleteConfig, MaxPlusConfig, Network, NetworkConfig, NetworkError, NetworkMetrics,
    NoProgress, TeamConfig, WorldConfig, assemble, builtin, metrics, picture,
};

/// The network-guided system.
pub struct NetworkSystem;

impl System for NetworkSystem {
    fn name(&self) -> &str {
        "network"
    }

    fn about(&self) -> &str {
        "sensor nodes plan the paths of rovers on a roadmap, with messages"
    }

    fn sections(&self) -> Vec<Section> {
        [
            WorldConfig::sections("world"),
            TeamConfig::sections("team"),
            NetworkConfig::sections("network"),
        ]
        .concat()
    }

    fn renamed(&self) -> Vec<Renamed> {
        let old_names = [
            ("failover_after", "takeover_after"),
            ("deadlock_window", "passive_window"),
            ("livelock_window", "active_window"),
        ];
        let renamed = old_names.map(|(new, old)| Renamed {
            old: format!("network.{old}"),
            new: format!("network.{new}"),
        });
        // Keys of one policy stood in `[network]` itself.
        let tables = [
            MaxPlusConfig::sections("network.max_plus"),
            CompleteConfig::sections("network.complete"),
        ];
        let sections = tables.iter().flatten();
        let keys = sections.flat_map(|section| section.keys.iter().map(move |key| (section, key)));
        let moved = keys.map(|(section, key)| {
            let (old, new) = (
                format!("network.{}", key.name),
                format!("{}.{}", section.name, key.name),
            );
            Renamed { old, new }
        });
        renamed.into_iter().chain(moved).collect()
    }

    fn metrics(&self) -> &[Metric] {
        metrics::all()
    }

    fn invariants(&self) -> &[Invariant] {
        &INVARIANTS
    }

    fn scenarios(&self) -> &[Builtin] {
        &builtin::SCENARIOS
    }

    fn studies(&self) -> &[Builtin] {
        &builtin::STUDIES
    }

    fn pictures(&self) -> &[PictureInfo] {
        &picture::ALL
    }

    fn parse(
        &self,
        sections: toml::Deserializer<'_>,
    ) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(NetworkScenario::deserialize(sections)?))
    }
}

/// What must never happen, or should not.
const INVARIANTS: [Invariant; 4] = [
    Invariant::new("collision", "collisions>0", "two rovers claim one place").lasting(),
    Invariant::new(
        "deadlock",
        "deadlocked=true",
        "some rover can never arrive any more",
    )
    .lasting(),
    Invariant::new(
        "no_progress",
        "stuck=true",
        "a deadlock, or no progress for long",
    )
    .lasting(),
    Invariant::new(
        "unfinished",
        "completed=false",
        "not all rovers have arrived",
    ),
];

impl Settings for NetworkScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn check(&self) -> Result<(), SetupError> {
        Table::check(&self.world, "world")?;
        Table::check(&self.team, "team")?;
        let checked = self.network.check();
        checked.map_err(|error| blame(NetworkError::Config(error)))
    }

    /// How its nodes plan; the policy itself is what they keep durably, and what they promise each other.
    fn taken_up_by(&self, key: &str) -> Option<Vec<Pattern>> {
        let of_policy = ["network.max_plus.", "network.complete."];
        let is_taken_up = of_policy.iter().any(|table| key.starts_with(table));
        is_taken_up.then(|| Pattern::over_names("node_*").into_iter().collect())
    }

    fn removable(&self) -> Vec<Removable> {
        let TeamConfig { rovers, only } = &self.team;
        let mut names: Vec<String> = (0..*rovers)
            .map(|rover| ids::name("rover", rover, *rovers))
            .collect();
        names.retain(|name| only.is_empty() || only.contains(name));
        vec![Removable::named("rovers", "team.only", names)]
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        let place = Place::of(self, setup)?;
        let (sensors, in_crater) = (place.sensors.clone(), in_crater(&self.world));
        let map = self.world.open_part(&place.roadmap, &sensors);
        let parts = place.parts(self);
        let system = setup.wired(|sim, wire| assemble(sim, &parts, &place.missions, wire));
        let system = Arc::new(system.map_err(blame)?);
        let scene = NetworkScene::new(
            map,
            sensors.clone(),
            system.cycle(),
            system.clone(),
            in_crater,
        );
        let watched = system.clone();
        let goal = Goal {
            what: "rovers arrived",
            of: system.team_size() as u64,
            done: Box::new(move || u64::from(watched.arrived())),
        };
        let notes = gaps(&sensors, &system);
        // Of a part of the team nobody has worked it out.
        let grid = place.grid.filter(|_| self.team.only.is_empty());
        let blocked = grid.map(|grid| {
            let all = grid.blocked();
            all.iter()
                .map(|blocked| grid.explain(blocked))
                .collect::<Vec<_>>()
        });
        let watched = system.clone();
        let watch = move |invariant: &str| invariant == "collision" && watched.collisions() > 0;
        let conclude = move |_: &Report| {
            let mut results = results(&system.metrics());
            if let Some(blocked) = &blocked {
                guarantee(&mut results, blocked);
            }
            results
        };
        Ok(Assembly::new(conclude)
            .with_goal(goal)
            .with_scene(scene)
            .with_watch(watch)
            .with_notes(notes))
    }

    fn account(
        &self,
        actor: &str,
        run: &dyn Recording,
        until_ns: Option<u64>,
        setup: &mut Setup<'_>,
    ) -> Result<Option<Account>, PictureError> {
        account::account(self, actor, run, until_ns, setup)
    }

    fn draw(
        &self,
        picture: &str,
        run: &dyn Recording,
        request: &PictureRequest,
        setup: &mut Setup<'_>,
    ) -> Result<Figure, PictureError> {
        picture::draw(self, picture, run, request, setup)
    }
}

/// Where nobody hears a rover, and which rovers that leaves without a way.
fn gaps(sensors: &SensorNetwork, system: &Network) -> Vec<String> {
    if sensors.gaps().is_empty() {
        return Vec::new();
    }
    let all: Vec<String> = sensors.gaps().iter().map(ToString::to_string).collect();
    let (count, reach_m) = (all.len(), sensors.coverage_m());
    let mut notes = vec![format!(
        "gaps: with a coverage of {reach_m} m no node covers {count} vertices: {}",
        all.join(", ")
    )];
    notes.extend(
        system
            .refused()
            .iter()
            .map(|refused| format!("  {refused}")),
    );
    notes
}

/// Says whether rovers that stay at their goals are sure to arrive: only on well-formed instances.
fn guarantee(results: &mut Results, blocked: &[String]) {
    let well_formed = blocked.is_empty();
    let metrics = &mut results.metrics;
    metrics.insert("well_formed".to_owned(), well_formed.into());
    metrics.insert("blocked_tasks".to_owned(), blocked.len().into());
    let text = match blocked {
        [] => "well-formed: there is a way for every rover, in any order".to_owned(),
        [first] => format!("not well-formed: {first}"),
        [first, rest @ ..] => format!("not well-formed: {first}; and {} more", rest.len()),
    };
    results.summary.push(("instance".to_owned(), text));
}

/// The most collisions that are named where a run is called wrong.
const NAMED_IN_A_LINE: usize = 3;

/// How many collisions there were, and the first of them by name.
fn violation(metrics: &NetworkMetrics) -> String {
    let count = metrics.collisions as usize;
    let named = metrics.collided.iter().take(NAMED_IN_A_LINE);
    let first: Vec<String> = named.map(ToString::to_string).collect();
    let rest = match count - first.len().min(count) {
        0 => String::new(),
        more => format!("; and {more} more"),
    };
    format!("{count} collisions: {}{rest}", first.join("; "))
}

fn results(metrics: &NetworkMetrics) -> Results {
    let mut results = Results::of(metrics);
    let mut line = |label: &str, text: String| {
        results.summary.push((label.to_owned(), text));
    };
    line(
        "rovers at their goals",
        format!("{} of {}", metrics.arrived, metrics.rovers),
    );
    line("collisions", metrics.collisions.to_string());
    let deadlock = results.metrics.get("deadlock").and_then(Value::as_str);
    let deadlock = deadlock.unwrap_or("unknown").to_owned();
    line("deadlock", deadlock);
    if metrics.no_progress != NoProgress::None {
        let (cycles, did) = (metrics.no_progress_cycles, metrics.no_progress);
        let did = match did {
            NoProgress::Moving => "rovers moved, and came no nearer",
            _ => "no rover moved",
        };
        line("no progress", format!("within {cycles} cycles: {did}"));
    }
    if let Some(shortest) = metrics.wait_cycles.first() {
        line("circles of rovers", metrics.wait_cycles.len().to_string());
        line("the shortest", shortest.to_string());
    } else if let Some((_, why)) = metrics
        .deadlock_reason
        .as_ref()
        .and_then(|s| s.split_once("; "))
    {
        line("why", why.to_owned());
    }
    if metrics.refused > 0 {
        line("rovers without a way", metrics.refused.to_string());
    }
    for replaced in &metrics.failed_over {
        line("failover", replaced.clone());
    }
    line("planning cycles", metrics.cycles.to_string());
    if metrics.arrived > 0 {
        line("time ratio", format!("{:.2}", metrics.time_ratio));
        line("path ratio", format!("{:.2}", metrics.path_ratio));
        line("stops per rover", format!("{:.1}", metrics.mean_stops));
    }
    if let Some(costs) = &metrics.costs
        && let (Some(sum), Some(makespan)) = (costs.sum_of_costs, costs.makespan)
    {
        let (least, ratio) = (costs.sum_of_costs_bound, costs.suboptimality.unwrap_or(1.0));
        line(
            "sum of costs",
            format!("{sum}, at least {least} ({ratio:.2})"),
        );
        let least = costs.makespan_bound;
        line("makespan", format!("{makespan}, at least {least}"));
    }
    if metrics.collisions > 0 {
        results.violations.push(violation(metrics));
    }
    results
}

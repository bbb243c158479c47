//! The network-guided system, as scenarios see it: `[world]`, `[team]`, `[network]`.

mod scene;

use std::sync::Arc;

use farside_actors::network::{
    self, NetworkConfig, NetworkMetrics, RoadmapSource, TeamConfig, WorldConfig,
};
use farside_worlds::{Crater, CraterSettings, Roadmap, SensorError, WorldError};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use scene::NetworkScene;

use super::{Conclude, Files, Goal, Results, Settings, Setup, SetupError, System};

/// The most bytes of a roadmap file that are read; the reader itself takes no more than 1 MiB.
const MAX_ROADMAP_BYTES: u64 = 2 << 20;

/// The most rovers: each has a link to and from each node, and memory is finite.
const MAX_ROVERS: u32 = 10_000;

pub(super) struct Network;

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct NetworkScenario {
    world: WorldConfig,
    team: TeamConfig,
    network: NetworkConfig,
}

impl System for Network {
    fn name(&self) -> &str {
        "network"
    }

    fn sections(&self) -> &[&str] {
        &["world", "team", "network"]
    }

    fn parse(
        &self,
        sections: toml::Deserializer<'_>,
    ) -> Result<Box<dyn Settings>, toml::de::Error> {
        Ok(Box::new(NetworkScenario::deserialize(sections)?))
    }
}

impl Settings for NetworkScenario {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Conclude, SetupError> {
        if !(1..=MAX_ROVERS).contains(&self.team.rovers) {
            let found = self.team.rovers;
            let message = format!("{found}: expected from 1 to {MAX_ROVERS}");
            return Err(SetupError::value("team.rovers", message));
        }
        let roadmap = Arc::new(roadmap(&self.world.roadmap, setup.files)?);
        let sensors = self.world.place(&roadmap, setup.seed).map_err(|error| {
            let key = match error {
                SensorError::NodeCount { .. } => "world.nodes",
                SensorError::Radius { .. } => "world.radius",
                // Which of the two to change is the user's choice; the message suggests a radius.
                _ if self.world.radius_m.is_some() => "world.radius",
                _ => "world.nodes",
            };
            SetupError::value(key, error)
        })?;
        let (world, team, settings) = (&self.world, &self.team, &self.network);
        let (map, posts) = (roadmap.clone(), Arc::new(sensors));
        let links = &mut *setup.links;
        let system = network::assemble(
            setup.sim,
            world,
            roadmap,
            posts.clone(),
            team,
            settings,
            setup.seed,
            &mut |sim, from, to| {
                links.connect(sim, from, to);
            },
        );
        let system = system.map_err(|error| SetupError::value(key_of(&error), error))?;
        let system = Arc::new(system);
        if setup.links.has_radios() {
            for (name, place_m) in system.places_m() {
                setup.links.place(name, place_m);
            }
            // The built-in roadmaps lie in the default crater; of others the ground is not known.
            let named = Roadmap::builtin_names().contains(&self.world.roadmap.name());
            if named {
                let crater = Crater::generate(&CraterSettings::default())
                    .map_err(|error| SetupError::value("world.roadmap", error))?;
                setup.links.terrain(Arc::new(crater.terrain().clone()));
            }
        }
        setup.scene = Some(Box::new(NetworkScene::new(map, posts, system.clone())));
        let watched = system.clone();
        setup.goal = Some(Goal {
            what: "rovers arrived",
            of: u64::from(self.team.rovers),
            done: Box::new(move || u64::from(watched.arrived())),
        });
        Ok(Box::new(move |_report| results(&system.metrics())))
    }
}

/// The built-in roadmap, the one in a file, or the one that the scenario has itself.
fn roadmap(source: &RoadmapSource, files: &mut Files) -> Result<Roadmap, SetupError> {
    let wrong = |message: String| SetupError::value("world.roadmap", message);
    if let Some(inline) = source.table() {
        return inline.map_err(|error| wrong(error.to_string()));
    }
    let name = source.name();
    if !name.ends_with(".toml") {
        return Roadmap::builtin(name).map_err(|error| match error {
            WorldError::UnknownRoadmap { .. } => {
                wrong(format!("{error} (a roadmap of your own is a .toml file)"))
            }
            other => wrong(other.to_string()),
        });
    }
    let bytes = files.read(name, MAX_ROADMAP_BYTES).map_err(wrong)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let at = error.utf8_error().valid_up_to();
        wrong(format!(
            "{name}: byte {at} is not UTF-8; expected TOML text"
        ))
    })?;
    Roadmap::from_toml(&text).map_err(|error| wrong(format!("{name}: {error}")))
}

/// The key to blame.
fn key_of(error: &network::NetworkError) -> &'static str {
    use network::{ConfigError, NetworkError};
    match error {
        NetworkError::NoRovers => "team.rovers",
        NetworkError::Endpoints { .. } => "world.endpoints",
        NetworkError::Config(ConfigError::Schedule { .. }) => "network.cycle",
        NetworkError::Config(ConfigError::Range { key, .. }) => KEYS
            .iter()
            .find(|known| known.ends_with(&format!(".{key}")))
            .unwrap_or(&"network"),
        _ => "network",
    }
}

/// The most collisions that are named where a run is called wrong.
const NAMED_IN_A_LINE: usize = 3;

/// The keys of `[network]` that have ranges.
const KEYS: [&str; 13] = [
    "network.cycle",
    "network.exchange",
    "network.iteration_timeout",
    "network.traverse",
    "network.longest_path_factor",
    "network.backtrack_penalty",
    "network.collision_penalty_factor",
    "network.noise",
    "network.convergence",
    "network.passive_window",
    "network.active_window",
    "network.cycle_limit",
    "network.sabotage",
];

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
    let mut results = Results::default();
    // A struct of plain numbers and names is always a JSON object.
    if let Ok(Value::Object(all)) = serde_json::to_value(metrics) {
        results.metrics = all;
    }
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
    if let Some(shortest) = metrics.wait_cycles.first() {
        line("circles of rovers", metrics.wait_cycles.len().to_string());
        line("the shortest", shortest.to_string());
    } else if let Some((_, why)) = metrics.standstill.as_ref().and_then(|s| s.split_once("; ")) {
        line("standstill", why.to_owned());
    }
    line("planning cycles", metrics.cycles.to_string());
    if metrics.arrived > 0 {
        line("time ratio", format!("{:.2}", metrics.time_ratio));
        line("path ratio", format!("{:.2}", metrics.path_ratio));
        line("stops per rover", format!("{:.1}", metrics.mean_stops));
    }
    if metrics.collisions > 0 {
        results.violations.push(violation(metrics));
    }
    results
}

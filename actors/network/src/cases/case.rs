//! A run of the network-guided system with all that goes wrong in it, small enough to be printed.

use std::fmt;
use std::sync::Arc;

use farside::fault::LookupError;
use farside::{BuildError, Executor, Report, SimDuration, SimTime, Simulation};
use farside_worlds::{Roadmap, RoadmapError, RoadmapTable, SensorError, WorldError};
use serde::Serialize;

use crate::{
    Missions, Network, NetworkConfig, NetworkError, NetworkMetrics, Parts, RoadmapSource,
    TeamConfig, WorldConfig, assemble, missions,
};
use farside_actors::link::{Degrade, LinkConfigError, LinkParams, LinksConfig};
use farside_actors::units;
use farside_actors::wiring::LinkBuilder;

/// A scenario of the network-guided system: what [`crate::assemble`] takes, with its links,
/// degradations and crashes.
///
/// It is shown, by `Display` and by `Debug`, as a scenario file that `farside run` reads, with
/// nothing in it that is as by default: read there it gives the same run, to the last event.
///
/// ```
/// use farside::SimDuration;
/// use farside_network::cases::{Case, Downtime};
/// let mut case = Case::default();
/// case.team.rovers = 2;
/// case.link.loss = 0.3;
/// let (at, up) = (SimDuration::from_secs(4), Some(SimDuration::from_millis(1500)));
/// case.crash.push(Downtime { actor: "node_07".to_owned(), at, restart_after: up });
/// assert_eq!(case.to_string(), r#"system = "network"
/// seed = 0
///
/// [world]
/// roadmap = "crater-dense"
/// nodes = 28
///
/// [team]
/// rovers = 2
///
/// [links.default]
/// loss = 0.3
///
/// [[crash]]
/// actor = "node_07"
/// at = "4s"
/// restart_after = "1.5s"
/// "#);
/// # case.crash.clear();
/// # case.link.loss = 0.0;
/// let (metrics, report) = case.run(farside::Executor::Inline)?;
/// assert_eq!((metrics.arrived, metrics.collisions), (2, 0));
/// # assert_eq!(report.end.name(), "stopped");
/// # Ok::<(), farside_network::cases::CaseError>(())
/// ```
#[derive(Clone, Default, PartialEq)]
pub struct Case {
    /// The run's seed; scenario files hold 63 bits of it.
    pub seed: u64,
    /// The roadmap and the nodes over it. No roadmap file is read here.
    pub world: WorldConfig,
    /// Who drives.
    pub team: TeamConfig,
    /// The algorithm and its protocol.
    pub network: NetworkConfig,
    /// What every link has.
    pub link: LinkParams,
    /// When links are worse.
    pub degrade: Vec<Degrade>,
    /// Who crashes when.
    pub crash: Vec<Downtime>,
}

/// An actor crashes, and comes back.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Downtime {
    /// The node or rover.
    pub actor: String,
    /// When it crashes, from the start of the run.
    #[serde(with = "units::duration")]
    pub at: SimDuration,
    /// How long it is down; without, for good.
    #[serde(
        with = "units::duration::option",
        skip_serializing_if = "Option::is_none"
    )]
    pub restart_after: Option<SimDuration>,
}

/// Why a case cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// Its roadmap is no roadmap.
    #[error(transparent)]
    Roadmap(#[from] RoadmapError),
    /// No roadmap of that name is built in.
    #[error(transparent)]
    World(#[from] WorldError),
    /// Its nodes cannot be placed.
    #[error(transparent)]
    Sensors(#[from] SensorError),
    /// The system cannot be assembled.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Its links or degradations make no sense.
    #[error(transparent)]
    Links(#[from] LinkConfigError),
    /// Nobody is called like the one that crashes.
    #[error(transparent)]
    Crash(#[from] LookupError),
    /// The simulation cannot start.
    #[error(transparent)]
    Build(#[from] BuildError),
}

impl Case {
    /// The roadmap.
    ///
    /// # Errors
    /// When it is none, or not built in.
    pub fn roadmap(&self) -> Result<Roadmap, CaseError> {
        match self.world.roadmap.table() {
            Some(inline) => Ok(inline?),
            None => Ok(Roadmap::builtin(self.world.roadmap.name())?),
        }
    }

    /// Declares the case in `sim`, which has its seed: to attach monitors to it, for example.
    ///
    /// # Errors
    /// When one of its parts makes no sense.
    pub fn assemble(&self, sim: &mut Simulation) -> Result<Network, CaseError> {
        let roadmap = Arc::new(self.roadmap()?);
        let sensors = Arc::new(self.world.place(&roadmap, self.seed)?);
        let links = LinksConfig {
            default: self.link.clone(),
            ..LinksConfig::default()
        };
        let mut links = Some(LinkBuilder::new(&links, &self.degrade)?);
        let missions = missions(&self.world, &roadmap, &self.team, self.seed)?;
        let parts = Parts {
            world: &self.world,
            roadmap,
            sensors,
            config: &self.network,
            terrain: None,
            only: &self.team.only,
        };
        let system = assemble(
            sim,
            &parts,
            &Missions::Queued(missions),
            &mut |sim, wiring| {
                let links = links.take().expect("a system is wired once");
                links.build(sim, wiring)
            },
        )?;
        for Downtime {
            actor,
            at,
            restart_after,
        } in &self.crash
        {
            let down = SimTime::ZERO + *at;
            sim.crash_named_at(down, actor)?;
            if let Some(after) = *restart_after {
                sim.restart_named_at(down + after, actor)?;
            }
        }
        Ok(system)
    }

    /// The same case with this seed, the next one, and so on.
    ///
    /// A property of cases is best tried with several: a smaller case rarely fails with the seed of
    /// the larger one, because seeds decide missions, placement and losses, but it fails with some.
    /// So it shrinks on.
    pub fn seeds(&self, count: u64) -> impl Iterator<Item = Case> + '_ {
        (0..count).map(|more| Case {
            seed: self.seed.wrapping_add(more),
            ..self.clone()
        })
    }

    /// Runs the case.
    ///
    /// # Errors
    /// When it cannot be run. What goes wrong in a run is in the report.
    pub fn run(&self, executor: Executor) -> Result<(NetworkMetrics, Report), CaseError> {
        let mut sim = Simulation::new(self.seed);
        let system = self.assemble(&mut sim)?;
        let report = sim.run(executor)?;
        Ok((system.metrics(), report))
    }
}

impl fmt::Display for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "system = \"network\"\nseed = {}", self.seed)?;
        writeln!(f, "\n[world]")?;
        match &self.world.roadmap {
            RoadmapSource::Named(name) => {
                writeln!(f, "roadmap = {}", toml::Value::String(name.clone()))?;
            }
            RoadmapSource::Inline(table) => write_roadmap(f, table)?,
        }
        writeln!(f, "nodes = {}", self.world.nodes)?;
        let usual = WorldConfig {
            roadmap: self.world.roadmap.clone(),
            nodes: self.world.nodes,
            ..WorldConfig::default()
        };
        write_table(f, "", &without(&self.world, &usual)?)?;
        writeln!(f, "\n[team]\nrovers = {}", self.team.rovers)?;
        let network = without(&self.network, &NetworkConfig::default())?;
        write_table(f, "[network]", &network)?;
        let link = LinkParams::default().changes_to(&self.link);
        write_table(f, "[links.default]", &table(&link)?)?;
        for degrade in &self.degrade {
            write_table(f, "[[degrade]]", &table(degrade)?)?;
        }
        for downtime in &self.crash {
            write_table(f, "[[crash]]", &table(downtime)?)?;
        }
        Ok(())
    }
}

/// The scenario: failing property tests show values in this way.
impl fmt::Debug for Case {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the scenario\n\n{self}")
    }
}

fn table<T: Serialize>(value: &T) -> Result<toml::Table, fmt::Error> {
    toml::Table::try_from(value).map_err(|_| fmt::Error)
}

/// The keys of `value` that are not as in `usual`.
fn without<T: Serialize>(value: &T, usual: &T) -> Result<toml::Table, fmt::Error> {
    let (mut all, usual) = (table(value)?, table(usual)?);
    all.retain(|key, value| usual.get(key) != Some(value));
    for (key, value) in &mut all {
        let usual = usual.get(key).and_then(toml::Value::as_table);
        if let (Some(below), Some(usual)) = (value.as_table_mut(), usual) {
            below.retain(|key, value| usual.get(key) != Some(value));
        }
    }
    Ok(all)
}

/// A table's header and keys; nothing if it is empty.
fn write_table(f: &mut fmt::Formatter<'_>, header: &str, table: &toml::Table) -> fmt::Result {
    if !header.is_empty() && !table.is_empty() {
        writeln!(f, "\n{header}")?;
    }
    for (key, value) in table {
        match value {
            toml::Value::Table(below) => {
                for (name, value) in below {
                    writeln!(f, "{key}.{name} = {value}")?;
                }
            }
            value => writeln!(f, "{key} = {value}")?,
        }
    }
    Ok(())
}

/// A roadmap on one line. Whole metres are written without a point.
fn write_roadmap(f: &mut fmt::Formatter<'_>, map: &RoadmapTable) -> fmt::Result {
    let list = |items: Vec<String>| format!("[{}]", items.join(", "));
    let whole = |x: f64| x.fract() == 0.0 && x.abs() < 1e9 && !(x == 0.0 && x.is_sign_negative());
    let number = |x: f64| match whole(x) {
        true => format!("{x:.0}"),
        false => format!("{x:?}"),
    };
    let place = |[x, y]: &[f64; 2]| format!("[{}, {}]", number(*x), number(*y));
    let boundary = map.boundary.iter().map(|v| v.0.to_string()).collect();
    let edges = map.edges.iter().map(|(u, v)| format!("[{}, {}]", u.0, v.0));
    write!(f, "roadmap = {{ boundary = {}", list(boundary))?;
    let places = map.positions_m.iter().map(place).collect();
    write!(f, ", positions_m = {}", list(places))?;
    if let Some(heights_m) = &map.heights_m {
        let heights = heights_m.iter().map(|h| number(*h)).collect();
        write!(f, ", heights_m = {}", list(heights))?;
    }
    writeln!(f, ", edges = {} }}", list(edges.collect()))
}

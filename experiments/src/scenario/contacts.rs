//! The `[contacts]` table: a contact plan that another program wrote, laid over the links of a
//! scenario's hosts. Here it is read, checked and mapped; what links do with windows is theirs.
//!
//! ```toml
//! [contacts]
//! file = "plan.ionrc"                       # or the name of a built-in plan: "mars-relay"
//! format = "ion"                            # or "hdtn"; told from the file unless given
//! nodes = { 1 = "earth", 2 = "orbiter" }    # which node of the plan is which host
//! offset = "1h"                             # when in the run the plan begins
//! range = "1.28s"                           # the light time of contacts of which it tells none
//! ```

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use farside::{SimDuration, Simulation};
use farside_actors::system::settings::{Table, one_of, such_that};
use farside_actors::{settings, units};
use farside_worlds::contacts::{
    Builtin, CapacityTrace, ContactFormat, ContactPlan, ContactWindow, MAX_FILE_BYTES, PlanSummary,
};

use farside::suggest::nearest;
use farside_actors::system::{Files, SetupError};

/// The most pairs that are told of one by one.
const MAX_NOTED: usize = 50;

settings! {
    /// The `[contacts]` table.
    ///
    /// ```
    /// use farside_experiments::scenario::contacts::ContactsConfig;
    /// let text = "file = 'plan.json'\nnodes = { 1 = 'earth' }";
    /// let config: ContactsConfig = toml::from_str(text)?;
    /// assert_eq!(config.nodes["1"], "earth");
    /// assert!(config.offset.is_zero());
    /// # Ok::<(), toml::de::Error>(())
    /// ```
    pub struct ContactsConfig {
        /// The plan's file, from the scenario's folder on; without a dot, the name of a built-in
        /// plan.
        pub file: String, such_that(
            "the name of a file or of a built-in plan",
            |file: &String| format!("{file:?}"),
            |file: &String| !file.is_empty(),
        );
        /// The file's format, if its ending or first character does not tell.
        pub format: Option<ContactFormat> [skip_serializing_if = "Option::is_none"],
            one_of(&["ion", "hdtn"]);
        /// Which node of the plan is which host; a node that is not here is the host of its own
        /// name.
        pub nodes: BTreeMap<String, String> [skip_serializing_if = "BTreeMap::is_empty"];
        /// When in the run the plan begins.
        pub offset: SimDuration [with = "units::duration"];
        /// The one-way light time of contacts of which the plan tells none: in ION, those without a
        /// range, which are passed over unless it is given; in HDTN, those without `owlt`, 0 unless
        /// it is given.
        pub range: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"];
    }
}

/// When which host hears which, by their names. Hosts that the plan names hear each other by its
/// contacts only; of other hosts it says nothing.
///
/// ```
/// use farside_experiments::scenario::contacts::{ContactsConfig, LinkContacts};
/// use farside_actors::system::Files;
/// let text = "file = 'mars-relay'\nnodes = { 1 = 'earth', 2 = 'orbiter', 3 = 'rover' }";
/// let config: ContactsConfig = toml::from_str(text)?;
/// let contacts = LinkContacts::read(&config, &mut Files::kept([].into()))?;
/// assert_eq!(contacts.windows("rover", "orbiter").unwrap().len(), 4);
/// assert_eq!(contacts.windows("rover", "earth"), Some(&[][..]));
/// assert_eq!(contacts.windows("rover", "lander"), None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct LinkContacts {
    file: String,
    format: ContactFormat,
    nodes: Vec<MappedNode>,
    plan: Arc<ContactPlan>,
    /// Whether a light time was given that no contact needs.
    is_range_idle: bool,
}

/// A node of the plan, and the host that it is.
#[derive(Clone, Debug, PartialEq)]
struct MappedNode {
    node: String,
    /// The first line of the plan that names it.
    line: usize,
    host: String,
    /// Whether `nodes` says so.
    is_given: bool,
}

impl LinkContacts {
    /// Reads the plan and gives its nodes the names of hosts.
    ///
    /// # Errors
    /// When the file cannot be read or is no plan, with its line; when `nodes` names what the plan
    /// does not have, or one host twice.
    pub fn read(config: &ContactsConfig, files: &mut Files) -> Result<Self, SetupError> {
        config.check("contacts")?;
        let wrong = |message: String| SetupError::value("contacts.file", message);
        let plans = || Builtin::plan_names();
        let (name, bytes) =
            open(&config.file, Builtin::find, plans(), "contact plan", files).map_err(wrong)?;
        let format = config.format;
        let format = format.unwrap_or_else(|| ContactFormat::guess(&name, &bytes));
        let plan = ContactPlan::read(&bytes, format, config.range)
            .map_err(|error| wrong(format!("{}: {error}", config.file)))?;
        // Without it there would be fewer contacts, or others.
        let is_range_idle = config.range.is_some()
            && ContactPlan::from_bytes(&bytes, format).is_ok_and(|bare| bare == plan);
        let nodes = mapped(config, &plan)?;
        let hosts: BTreeMap<&str, &str> = nodes
            .iter()
            .map(|node| (node.node.as_str(), node.host.as_str()))
            .collect();
        let host = |node: &str| hosts[node].to_owned();
        let plan = plan.renamed(host, config.offset).ok_or_else(|| {
            let message = "with it, contacts end more than 584 years into the run";
            SetupError::value("contacts.offset", message)
        })?;
        let plan = plan.map_err(|error| wrong(format!("{}: {error}", config.file)))?;
        Ok(LinkContacts {
            file: config.file.clone(),
            format,
            nodes,
            plan: Arc::new(plan),
            is_range_idle,
        })
    }

    /// The contacts of the link from one host to another, in order and apart. `None` if the plan
    /// does not name both hosts, so that it says nothing about the link; none at all if it does,
    /// but has no contact between them.
    pub fn windows(&self, from: &str, to: &str) -> Option<&[ContactWindow]> {
        self.plan.windows_between(from, to)
    }

    /// The plan, its nodes called as the hosts that they are, in the run's time.
    pub fn plan(&self) -> &Arc<ContactPlan> {
        &self.plan
    }

    /// Each ordered pair of hosts with contacts, sorted by their names.
    pub fn pairs(&self) -> impl Iterator<Item = (&str, &str, &[ContactWindow])> {
        self.plan.pairs()
    }

    /// What is to be said of the plan's file: contacts that were passed over, and what it says
    /// without effect.
    pub fn remarks(&self) -> impl Iterator<Item = String> + '_ {
        let idle = self.is_range_idle.then(|| {
            "contacts.range has no effect: every contact has a light time of its own".to_owned()
        });
        let remarks = self.plan.remarks();
        let remarks = remarks.map(|remark| format!("contacts: {}: {remark}", self.file));
        remarks.chain(idle)
    }

    /// What the contacts come to.
    pub fn summary(&self) -> PlanSummary {
        PlanSummary::of(self.pairs())
    }

    /// Checks that the nodes are hosts of the simulation, once that has them.
    ///
    /// # Errors
    /// When one is not: with the key if `nodes` names it, else with its line in the plan.
    pub fn check_hosts(&self, sim: &Simulation) -> Result<(), SetupError> {
        let hosts: BTreeSet<&str> = sim.host_names().collect();
        let mut strangers = self
            .nodes
            .iter()
            .filter(|node| !hosts.contains(node.host.as_str()));
        let Some(stranger) = strangers.next() else {
            return Ok(());
        };
        let nearest = nearest(&stranger.host, hosts.iter().copied());
        let hint = nearest.map_or_else(String::new, |host| format!("; did you mean {host:?}?"));
        let MappedNode {
            node, line, host, ..
        } = stranger;
        if stranger.is_given {
            let message = format!("{host:?} is no host{hint}");
            return Err(SetupError::value(
                &format!("contacts.nodes.{node}"),
                message,
            ));
        }
        let file = &self.file;
        let message = format!(
            "{file}: line {line}: node {node:?} is no host{hint} Expected nodes = {{ {node:?} = \
             \"...\" }} to say which it is"
        );
        Err(SetupError::value("contacts.nodes", message))
    }

    /// What the plan became, a line at a time, for people.
    pub(crate) fn notes(&self, sim: &Simulation) -> Vec<String> {
        let format = match self.format {
            ContactFormat::Ion => "ION",
            ContactFormat::Hdtn => "HDTN",
        };
        let summary = self.summary();
        let links: BTreeSet<&str> = sim.link_names().collect();
        let mut notes = vec![format!("contacts: {:?}, read as {format}", self.file)];
        // The plan as a whole first, then its pairs.
        let whole = summary.to_string();
        notes.extend(
            whole
                .lines()
                .take(1 + MAX_NOTED)
                .map(|line| format!("  {line}")),
        );
        if summary.pairs.len() > MAX_NOTED {
            let rest = summary.pairs.len() - MAX_NOTED;
            notes.push(format!("  and {rest} more pairs"));
        }
        let unlinked = summary.pairs.iter().filter(|pair| {
            let link = format!("{}-{}", pair.from, pair.to);
            !links.contains(link.as_str())
        });
        let unlinked: Vec<String> = unlinked
            .map(|p| format!("{} -> {}", p.from, p.to))
            .collect();
        if !unlinked.is_empty() {
            let shown = unlinked[..unlinked.len().min(MAX_NOTED)].join(", ");
            let count = unlinked.len();
            notes.push(format!(
                "  of no use, for want of a link ({count}): {shown}"
            ));
        }
        notes
    }
}

/// Reads a capacity trace: a mahimahi file, or without a dot, the name of a built-in trace.
///
/// ```
/// use farside_experiments::scenario::contacts::read_trace;
/// use farside_actors::system::Files;
/// let trace = read_trace("rover-radio", &mut Files::kept([].into()))?;
/// assert_eq!(
///     trace.to_string(),
///     "40 packets of 1500 bytes in 278ms, 1726618 bit/s on average, longest gap 14ms"
/// );
/// # Ok::<(), String>(())
/// ```
///
/// # Errors
/// With a message that begins with the file's name, and names the line.
pub fn read_trace(file: &str, files: &mut Files) -> Result<CapacityTrace, String> {
    let traces = Builtin::trace_names();
    let (_, bytes) = open(file, Builtin::find_trace, traces, "trace", files)?;
    CapacityTrace::from_mahimahi(&bytes).map_err(|error| format!("{file}: {error}"))
}

/// The file's name and content; one without a dot is built in.
fn open(
    file: &str,
    find: fn(&str) -> Option<Builtin>,
    mut known: impl Iterator<Item = &'static str>,
    what: &str,
    files: &mut Files,
) -> Result<(String, Vec<u8>), String> {
    if file.contains('.') {
        let bytes = files.read(file, MAX_FILE_BYTES as u64)?;
        return Ok((file.to_owned(), bytes));
    }
    match find(file) {
        Some(built_in) => Ok((built_in.file_name.to_owned(), built_in.bytes.to_vec())),
        None => {
            let nearest = nearest(file, known.by_ref());
            let hint = nearest.map_or_else(String::new, |name| format!("; did you mean {name:?}?"));
            Err(format!(
                "there is no {what} {file:?} built in{hint} (a file of your own has an ending)"
            ))
        }
    }
}

/// The nodes of a plan as hosts.
fn mapped(config: &ContactsConfig, plan: &ContactPlan) -> Result<Vec<MappedNode>, SetupError> {
    let mut hosts: BTreeMap<&str, &str> = BTreeMap::new();
    let mut nodes = Vec::new();
    for (node, line) in plan.nodes() {
        let given = config.nodes.get(node);
        let host = given.map_or(node, String::as_str);
        if let Some(other) = hosts.insert(host, node) {
            let message = format!("{host:?} is node {other} already: expected another host");
            return Err(SetupError::value(
                &format!("contacts.nodes.{node}"),
                message,
            ));
        }
        nodes.push(MappedNode {
            node: node.to_owned(),
            line,
            host: host.to_owned(),
            is_given: given.is_some(),
        });
    }
    let is_known = |node: &str| nodes.iter().any(|known| known.node == node);
    match config.nodes.keys().find(|node| !is_known(node)) {
        None => Ok(nodes),
        Some(stranger) => {
            let names = nodes.iter().map(|node| node.node.as_str());
            let names = names.take(20).collect::<Vec<_>>().join(", ");
            let message = format!("the plan has no node {stranger:?}: expected one of {names}");
            Err(SetupError::value(
                &format!("contacts.nodes.{stranger}"),
                message,
            ))
        }
    }
}

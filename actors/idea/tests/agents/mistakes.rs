//! What is said of scenarios that cannot be.

use crate::mission::K9;
use crate::scenario::refused;

#[test]
fn mistakes_are_named_by_their_keys() {
    let with = |old: &str, new: &str| {
        assert!(K9.contains(old), "{old}");
        refused(&K9.replace(old, new))
    };
    let says = |message: String, parts: &[&str]| {
        for part in parts {
            assert!(message.contains(part), "{part}: {message}");
        }
    };
    says(
        with("[links.default]", "[links.default]\nloss = 0\n"),
        &["nothing"],
    );
    // A poll lasts a second: its answer would come too late.
    says(
        with("latency = \"20ms\"", "latency = \"500ms\""),
        &["links", "1s to k9 and back", "Pitch_SV"],
    );
    let agent = |key: &str| with("[system_agent]", &format!("[system_agent]\n{key}\n"));
    says(
        agent("model = 'k9-sistem'"),
        &["system_agent.model", "did you mean \"k9-system\"?"],
    );
    says(agent("model = 'k9-mission'"), &["system_agent"]);
    says(
        agent("latency = '0s'"),
        &["system_agent.latency", "more than 0s"],
    );
    says(
        agent("technology = 'compiled'\nhorizon = 2"),
        &["system_agent.horizon", "temporal"],
    );
    says(agent("technology = 'temporel'"), &["temporal"]);
    says(
        with("name = \"wall\"", "name = \"wall\"\nrover = \"k8\""),
        &["goal.4.rover", "\"k8\" matches no rover of k9"],
    );
    says(
        with("camera = \"haz_front\"", "camera = \"haz\""),
        &["goal.5.camera", "haz_front"],
    );
    says(
        with("[links.default]", "[agents]\nlayers = 1\n\n[links.default]")
            .replace("nothing", "it ran"),
        &["it ran"],
    );
    says(
        refused(
            &K9.replace("name = \"wall\"", "name = \"wall\"\nrecalled = \"3s\"")
                .replace("[links.default]", "[agents]\nlayers = 1\n\n[links.default]"),
        ),
        &["goal.4.recalled", "agents.layers"],
    );
    says(with("model = \"k9\"", "model = \"mer\""), &["relay.table"]);
}

//! What a scenario says of a survey: `[survey]`, besides the tables of the field, the team, the rovers, what is
//! learnt, how it is planned and carried out, and goals of one's own.

use farside::SimDuration;
use farside_actors::processor::Speed;
use farside_actors::system::settings::{if_set, over};
use farside_actors::{settings, units};

use crate::shac::Reassign;

settings! {
    /// The `[survey]` table: where the centre is, how goals change hands, and when.
    pub struct SurveyConfig {
        /// Where the centre and its scientist are: `lander`, in the middle of the field, or a rover's name.
        pub central: String = "lander".to_owned();
        /// How goals change hands: `assign-and-release` (the paper's), `lease`, `market`, or a protocol of
        /// the file of `protocol_file`.
        pub protocol: String = "lease".to_owned();
        /// A file with protocols of one's own.
        pub protocol_file: Option<String> [skip_serializing_if = "Option::is_none"];
        /// When a goal is handed out again whose rover does not answer: `never` or `lease`; as the
        /// protocol says unless given.
        pub reassign: Option<Reassign> [skip_serializing_if = "Option::is_none"];
        /// For how long a rover may start a goal after the centre last heard of it; as the protocol says
        /// unless given.
        pub lease: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"],
            if_set(over(SimDuration::ZERO));
        /// After which silence of the centre another one is elected among the rovers; never unless given.
        pub election: Option<SimDuration>
            [with = "units::duration::option", skip_serializing_if = "Option::is_none"],
            if_set(over(SimDuration::ZERO));
        /// The share of the time in which anything is sent but within a host: at once with 1, in windows
        /// otherwise.
        pub contact: f64 [with = "units::fraction"] = 1.0;
        /// The time from the beginning of a window to that of the next.
        pub contact_every: SimDuration [with = "units::duration"] = SimDuration::from_secs(2 * 3600),
            over(SimDuration::ZERO);
        /// How often the scientist at the centre asks the prioritiser what to look at next.
        pub loop_every: SimDuration [with = "units::duration"] = SimDuration::from_secs(3 * 3600),
            over(SimDuration::ZERO);
        /// How many rocks are wished for at a time.
        pub rocks: u32 = 12, 0..=1_000;
        /// How many squares of the ground are wished for at a time, as panoramas.
        pub squares: u32 = 3, 0..=1_000;
        /// What a goal of the prioritiser weighs, by how much it is worth to the prioritiser, so that both can
        /// be compared with goals of one's own.
        pub scale: f64 = 10.0, 0.001..=1e6;
        /// How fast the processors of planners are, in operations.
        pub processor: Speed = Speed::PerS(20_000);
    }
}

//! What a crate of a system needs, in one `use`, beside the kernel's own prelude.
//!
//! ```
//! use farside::prelude::*;
//! use farside_actors::prelude::*;
//!
//! settings! {
//!     /// The `[base]` table.
//!     struct Base {
//!         /// How many antennas there are.
//!         antennas: u32 = 1, 1..=8;
//!     }
//! }
//!
//! impl OwnTable for Base {
//!     const NAME: &'static str = "base";
//!     const ABOUT: &'static str = "a base that nobody calls";
//!     const METRICS: &'static [Metric] =
//!         &[Metric::number("antennas", "antennas", "", Better::Higher)];
//!
//!     fn assemble(&self, _setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
//!         let antennas = self.antennas;
//!         Ok(Assembly::new(move |_| Results::default().metric("antennas", antennas)))
//!     }
//! }
//! assert_eq!(Base::system().name(), "base");
//! ```

pub use farside::record::{Record, RecordClass};
pub use farside::scene::{Drawing, Level, Scene};

pub use crate::figure::{Figure, svg};
pub use crate::system::settings::{in_unit, over};
pub use crate::system::{
    Assembly, Better, Builtin, Entries, Gathered, Invariant, Metric, OwnTable, PictureError,
    PictureInfo, PictureRequest, Recording, Removable, Results, Series, SeriesIndex, Setup,
    SetupError, System,
};
pub use crate::wiring::Wiring;
pub use crate::{settings, units};

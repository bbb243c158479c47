//! Systems whose scenario has one table of their own: less to write for what most systems are.

use std::collections::BTreeMap;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::settings::Table;
use super::{
    Assembly, Builtin, Invariant, Metric, PictureError, PictureInfo, PictureRequest, Recording,
    Removable, Section, Settings, Setup, SetupError, System,
};
use crate::figure::Figure;

/// A table of settings that says how its system is assembled: the whole of a system that reads no
/// other table. `tests/outside` in the repository is one, with all that a system can have.
///
/// ```
/// use farside_actors::settings;
/// use farside_actors::system::{Assembly, OwnTable, Results, Setup, SetupError, System};
///
/// settings! {
///     /// The `[beacons]` table.
///     struct Beacons {
///         /// How many beacons there are.
///         count: u32 = 2, 1..=100;
///     }
/// }
///
/// impl OwnTable for Beacons {
///     const NAME: &'static str = "beacons";
///     const ABOUT: &'static str = "beacons that do nothing yet";
///
///     fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
///         (1..=self.count).for_each(|beacon| drop(setup.sim.host(&format!("beacon_{beacon}"))));
///         let count = self.count;
///         Ok(Assembly::new(move |_| Results::default().metric("beacons", count)))
///     }
/// }
///
/// assert_eq!(Beacons::system().name(), "beacons");
/// assert_eq!(Beacons::system().sections()[0].keys[0].name, "count");
/// ```
pub trait OwnTable: Table + DeserializeOwned + Send + Sync + 'static {
    /// The name of the table and of the system.
    const NAME: &'static str;

    /// As [`System::about`].
    const ABOUT: &'static str;

    /// As [`System::metrics`].
    const METRICS: &'static [Metric] = &[];

    /// As [`System::invariants`].
    const INVARIANTS: &'static [Invariant] = &[];

    /// As [`System::scenarios`].
    const SCENARIOS: &'static [Builtin] = &[];

    /// As [`System::studies`].
    const STUDIES: &'static [Builtin] = &[];

    /// As [`System::pictures`].
    const PICTURES: &'static [PictureInfo] = &[];

    /// As [`System::problem`].
    const PROBLEM: Option<&'static str> = None;

    /// As [`Settings::assemble`].
    ///
    /// # Errors
    /// When the settings cannot be; the error names the key.
    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError>;

    /// As [`Settings::removable`].
    fn removable(&self) -> Vec<Removable> {
        Vec::new()
    }

    /// As [`Settings::problem`].
    ///
    /// # Errors
    /// When the settings cannot be; the error names the key.
    fn problem(&self, _setup: &mut Setup<'_>) -> Result<Option<String>, SetupError> {
        Ok(None)
    }

    /// As [`Settings::draw`].
    ///
    /// # Errors
    /// When the recording has not what the picture shows, or an option makes no sense.
    fn draw(
        &self,
        picture: &str,
        _run: &dyn Recording,
        _request: &PictureRequest,
    ) -> Result<Figure, PictureError> {
        Err(PictureError::Unknown {
            picture: picture.to_owned(),
        })
    }

    /// The system.
    fn system() -> impl System + 'static {
        OfTable(PhantomData::<fn() -> Self>)
    }
}

/// The system of a table.
struct OfTable<T>(PhantomData<fn() -> T>);

impl<T: OwnTable> System for OfTable<T> {
    fn name(&self) -> &str {
        T::NAME
    }

    fn about(&self) -> &str {
        T::ABOUT
    }

    fn sections(&self) -> Vec<Section> {
        T::sections(T::NAME)
    }

    fn metrics(&self) -> &[Metric] {
        T::METRICS
    }

    fn invariants(&self) -> &[Invariant] {
        T::INVARIANTS
    }

    fn scenarios(&self) -> &[Builtin] {
        T::SCENARIOS
    }

    fn studies(&self) -> &[Builtin] {
        T::STUDIES
    }

    fn pictures(&self) -> &[PictureInfo] {
        T::PICTURES
    }

    fn problem(&self) -> Option<&str> {
        T::PROBLEM
    }

    fn parse(&self, keys: toml::Deserializer<'_>) -> Result<Box<dyn Settings>, toml::de::Error> {
        let mut tables = BTreeMap::<String, T>::deserialize(keys)?;
        Ok(Box::new(Alone(tables.remove(T::NAME).unwrap_or_default())))
    }
}

/// A table as the settings of its system.
struct Alone<T>(T);

impl<T: OwnTable> Settings for Alone<T> {
    fn resolved(&self) -> Result<toml::Table, toml::ser::Error> {
        let table = toml::Value::try_from(&self.0)?;
        Ok([(T::NAME.to_owned(), table)].into_iter().collect())
    }

    fn check(&self) -> Result<(), SetupError> {
        self.0.check(T::NAME)
    }

    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError> {
        self.0.assemble(setup)
    }

    fn removable(&self) -> Vec<Removable> {
        self.0.removable()
    }

    fn problem(&self, setup: &mut Setup<'_>) -> Result<Option<String>, SetupError> {
        self.0.problem(setup)
    }

    fn draw(
        &self,
        picture: &str,
        run: &dyn Recording,
        request: &PictureRequest,
        _setup: &mut Setup<'_>,
    ) -> Result<Figure, PictureError> {
        self.0.draw(picture, run, request)
    }
}

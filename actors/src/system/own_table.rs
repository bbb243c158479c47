//! Systems whose scenario has one table of their own: less to write for what most systems are.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::settings::Table;
use super::{
    Assembly, Files, PictureError, PictureRequest, Recording, Settings, Setup, SetupError,
};
use crate::figure::Figure;

/// A table of settings that says how its system is assembled: [`Settings`] of a system that reads
/// no other table.
pub trait OwnTable: Table + DeserializeOwned + Send + Sync + 'static {
    /// The table's name.
    const NAME: &'static str;

    /// As [`Settings::assemble`].
    ///
    /// # Errors
    /// When the settings cannot be; the error names the key.
    fn assemble(&self, setup: &mut Setup<'_>) -> Result<Assembly, SetupError>;

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

    /// Reads the table, if it is there: what [`System::parse`](super::System::parse) is to do.
    ///
    /// # Errors
    /// Those of serde.
    fn parse(sections: toml::Deserializer<'_>) -> Result<Box<dyn Settings>, toml::de::Error> {
        let mut tables = BTreeMap::<String, Self>::deserialize(sections)?;
        Ok(Box::new(Alone(
            tables.remove(Self::NAME).unwrap_or_default(),
        )))
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

    fn draw(
        &self,
        picture: &str,
        run: &dyn Recording,
        request: &PictureRequest,
        _files: &mut Files,
    ) -> Result<Figure, PictureError> {
        self.0.draw(picture, run, request)
    }
}

//! What a system makes of a scenario without a run: the problem of its planners, pictures of a run that was
//! recorded.

use farside::Simulation;
use farside_actors::figure::Figure;
use farside_actors::system::{
    Account, Files, PictureError, PictureRequest, Recording, Seeds, Setup, SetupError,
};

use super::{Scenario, ScenarioError};

impl Scenario {
    /// What its planners have to solve, as the text of a file, if its system has such a thing; and the
    /// files that were read for it.
    ///
    /// ```
    /// use farside_experiments::{registry::Registry, scenario::Scenario};
    /// let scenario = Scenario::open("misus/planners", &[], &Registry::builtin())?;
    /// let (problem, _) = scenario.problem()?;
    /// assert!(problem.is_some_and(|text| text.contains("\"goals\"")));
    /// # Ok::<(), farside_experiments::scenario::ScenarioError>(())
    /// ```
    ///
    /// # Errors
    /// When the settings cannot be.
    pub fn problem(&self) -> Result<(Option<String>, Files), ScenarioError> {
        let mut files = self.files.clone();
        let problem = self.with_setup(self.seeds(), &mut files, |setup| {
            self.settings.problem(setup)
        });
        let wrong = |error| ScenarioError::from_setup(&self.source, error);
        Ok((problem.map_err(wrong)?, files))
    }

    /// Draws a picture that its system has, from what a run of it recorded.
    ///
    /// # Errors
    /// When there is no such picture, or the recording has not what it shows.
    pub(crate) fn draw(
        &self,
        picture: &str,
        run: &dyn Recording,
        request: &PictureRequest,
    ) -> Result<Figure, PictureError> {
        self.with_setup(run.seeds(), &mut self.files.clone(), |setup| {
            self.settings.draw(picture, run, request, setup)
        })
    }

    /// What an actor did in a recorded run up to a time, as its system tells it.
    ///
    /// # Errors
    /// When the recording has not what it is told from.
    pub(crate) fn account(
        &self,
        actor: &str,
        run: &dyn Recording,
        until_ns: u64,
    ) -> Result<Option<Account>, PictureError> {
        self.with_setup(run.seeds(), &mut self.files.clone(), |setup| {
            self.settings.account(actor, run, Some(until_ns), setup)
        })
    }

    /// What its system makes of what a run with these seeds is built from, without a run.
    fn with_setup<T, E: From<SetupError>>(
        &self,
        seeds: Seeds,
        files: &mut Files,
        work: impl FnOnce(&mut Setup<'_>) -> Result<T, E>,
    ) -> Result<T, E> {
        let links = self.links(files)?.links;
        let mut sim = Simulation::new(seeds.run);
        work(&mut Setup::new(seeds, self.until(), &mut sim, files, links))
    }
}

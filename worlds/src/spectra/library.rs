//! Libraries of measured spectra with known mineral fractions, read from CSV.

use std::borrow::Cow;
use std::collections::BTreeMap;

use super::{
    FRACTION_TOLERANCE, LibraryError, LibraryProblem, MAX_BANDS, MAX_FILE_BYTES, MAX_MINERALS,
    MAX_REFLECTANCE, MAX_WAVELENGTH_NM,
};

/// The library that is built in: 113 samples of the data set of D. Korda and others, *Neural
/// network for determining an asteroid mineral composition from reflectance spectra* (A&A 669, 2023),
/// most of them measured at RELAB. Each spectrum is divided by its value at 550 nm.
const BUILTIN: &[u8] = include_bytes!("../../data/spectra/mineral-spectra-sample.csv");

/// Measured spectra of samples whose mineral fractions are known.
///
/// A CSV file: a header with `id`, a column for each mineral (any names), and a column `rNNN` for
/// each band, NNN being its wavelength in nanometres, ascending; below it, a line for each sample.
/// Fields may stand in double quotes; empty lines count for nothing.
///
/// ```
/// use farside_worlds::spectra::SpectralLibrary;
/// let library = SpectralLibrary::builtin();
/// assert_eq!(library.minerals(), ["olivine", "orthopyroxene", "clinopyroxene", "plagioclase"]);
/// assert_eq!((library.len(), library.wavelengths_nm().len()), (113, 101));
/// assert_eq!(library.sample(0).id, "DP-JNG-006");
/// assert_eq!(library.sample(0).dominant_mineral(), 0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SpectralLibrary {
    minerals: Vec<String>,
    wavelengths_nm: Vec<f64>,
    ids: Vec<String>,
    /// Sample by sample, all minerals.
    fractions: Vec<f64>,
    /// Sample by sample, all bands.
    reflectance: Vec<f64>,
}

/// One sample of a library.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LibrarySample<'a> {
    /// Its name.
    pub id: &'a str,
    /// The fraction of each mineral by volume; they sum to 1.
    pub fractions: &'a [f64],
    /// Its reflectance in each band, 0 to [`MAX_REFLECTANCE`].
    pub reflectance: &'a [f64],
}

impl LibrarySample<'_> {
    /// The mineral that it has most of; of equal ones the first.
    pub fn dominant_mineral(&self) -> usize {
        let mut most = 0;
        for (mineral, fraction) in self.fractions.iter().enumerate() {
            if *fraction > self.fractions[most] {
                most = mineral;
            }
        }
        most
    }
}

impl SpectralLibrary {
    /// The library that is built in: 113 samples of minerals, mixtures and meteorites, measured by
    /// RELAB for the most part.
    ///
    /// # Panics
    /// Never: a test reads it.
    pub fn builtin() -> SpectralLibrary {
        SpectralLibrary::from_csv(BUILTIN).expect("the built-in library is in order")
    }

    /// Reads a library from a CSV file.
    ///
    /// # Errors
    /// When it is no such file. The error names the line, and the column if it is one that is wrong:
    /// bands that are missing, not ascending or given twice, values that are not finite or outside
    /// their range, fractions that do not sum to 1 within [`FRACTION_TOLERANCE`], ids given twice, no
    /// sample, bytes that are no text, and files over [`MAX_FILE_BYTES`].
    pub fn from_csv(bytes: &[u8]) -> Result<SpectralLibrary, LibraryError> {
        let text = text_of(bytes)?;
        let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line));
        let mut lines = lines.filter(|(_, line)| !line.trim().is_empty());
        let Some((header_line, header)) = lines.next() else {
            return Err(LibraryError::NoHeader);
        };
        let header = Header::read(header_line, header)?;
        let mut library = SpectralLibrary {
            minerals: header.minerals().to_vec(),
            wavelengths_nm: header.wavelengths_nm.clone(),
            ids: Vec::new(),
            fractions: Vec::new(),
            reflectance: Vec::new(),
        };
        let mut line_of: BTreeMap<String, usize> = BTreeMap::new();
        for (line, row) in lines {
            library.read_row(&header, line, row)?;
            let id = library.ids.last().cloned().unwrap_or_default();
            if let Some(&other_line) = line_of.get(&id) {
                let id = shown(&id);
                return Err(field(
                    line,
                    "id",
                    LibraryProblem::DuplicateId { id, other_line },
                ));
            }
            line_of.insert(id, line);
        }
        match library.is_empty() {
            true => Err(LibraryError::NoSample),
            false => Ok(library),
        }
    }

    /// Adds the sample of one line.
    fn read_row(&mut self, header: &Header, line: usize, row: &str) -> Result<(), LibraryError> {
        let expected = header.names.len();
        let (fields, actual) = fields_of(line, row, expected)?;
        if actual != expected {
            let problem = LibraryProblem::FieldCount {
                actual,
                expected,
                missing: header.names.get(fields.len()).map(|name| shown(name)),
            };
            return Err(LibraryError::Line { line, problem });
        }
        if fields[0].is_empty() {
            return Err(field(line, "id", LibraryProblem::NoId));
        }
        let first_band = 1 + self.minerals.len();
        let from = self.fractions.len();
        for (name, text) in header.names.iter().zip(&fields).take(first_band).skip(1) {
            let Some(value) = number_within(text, 1.0) else {
                let found = shown(text);
                return Err(field(line, name, LibraryProblem::Fraction { found }));
            };
            self.fractions.push(value);
        }
        let sum: f64 = self.fractions[from..].iter().sum();
        if (sum - 1.0).abs() > FRACTION_TOLERANCE {
            let problem = LibraryProblem::FractionSum { sum };
            return Err(LibraryError::Line { line, problem });
        }
        for fraction in &mut self.fractions[from..] {
            *fraction /= sum;
        }
        for (name, text) in header.names.iter().zip(&fields).skip(first_band) {
            let Some(value) = number_within(text, MAX_REFLECTANCE) else {
                let found = shown(text);
                return Err(field(line, name, LibraryProblem::Reflectance { found }));
            };
            self.reflectance.push(value);
        }
        self.ids.push(fields[0].clone().into_owned());
        Ok(())
    }

    /// The minerals whose fractions are known, in the order of fractions; at least one.
    pub fn minerals(&self) -> &[String] {
        &self.minerals
    }

    /// The wavelengths of the bands \[nm\], ascending; at least two.
    pub fn wavelengths_nm(&self) -> &[f64] {
        &self.wavelengths_nm
    }

    /// How many samples there are; at least one.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// Whether there is none, which no library that was read is.
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// A sample by its place in the file, from 0.
    ///
    /// # Panics
    /// When there is no such sample.
    pub fn sample(&self, sample: usize) -> LibrarySample<'_> {
        let (minerals, bands) = (self.minerals.len(), self.wavelengths_nm.len());
        LibrarySample {
            id: &self.ids[sample],
            fractions: &self.fractions[sample * minerals..(sample + 1) * minerals],
            reflectance: &self.reflectance[sample * bands..(sample + 1) * bands],
        }
    }

    /// All samples, in the order of the file.
    pub fn samples(&self) -> impl Iterator<Item = LibrarySample<'_>> {
        (0..self.len()).map(|sample| self.sample(sample))
    }
}

/// What the first line says.
struct Header {
    names: Vec<String>,
    wavelengths_nm: Vec<f64>,
}

impl Header {
    fn minerals(&self) -> &[String] {
        &self.names[1..self.names.len() - self.wavelengths_nm.len()]
    }

    fn read(line: usize, text: &str) -> Result<Header, LibraryError> {
        let (fields, count) = fields_of(line, text, 1 + MAX_MINERALS + MAX_BANDS)?;
        let names: Vec<String> = fields.into_iter().map(Cow::into_owned).collect();
        let unknown = |name: &str, expected, nearest: String| {
            field(
                line,
                name,
                LibraryProblem::UnknownColumn { expected, nearest },
            )
        };
        if names[0] != "id" {
            let expected = "`id` as the first column";
            return Err(unknown(&names[0], expected, "id".to_owned()));
        }
        let mut wavelengths_nm: Vec<f64> = Vec::new();
        for name in &names[1..] {
            let Some(wavelength_nm) = wavelength_of(name) else {
                // Minerals come before bands; what looks like a band is meant to be one.
                let digits = name.bytes().any(|byte| byte.is_ascii_digit());
                if wavelengths_nm.is_empty() && !digits && is_name(name) {
                    continue;
                }
                let expected =
                    "`id`, names of minerals, and then bands `rNNN`, NNN being nanometres";
                return Err(unknown(name, expected, nearest_band(name, &wavelengths_nm)));
            };
            if !(wavelength_nm > 0.0 && wavelength_nm <= MAX_WAVELENGTH_NM) {
                return Err(field(line, name, LibraryProblem::Wavelength));
            }
            if let Some(&before_nm) = wavelengths_nm.last()
                && wavelength_nm <= before_nm
            {
                let actual_nm = wavelength_nm;
                let problem = LibraryProblem::Unsorted {
                    before_nm,
                    actual_nm,
                };
                return Err(field(line, name, problem));
            }
            wavelengths_nm.push(wavelength_nm);
        }
        let minerals = names.len() - 1 - wavelengths_nm.len();
        // Columns that were counted and not kept are too many of something already.
        let beyond = count - names.len();
        let problem = match (minerals, wavelengths_nm.len() + beyond) {
            (0, _) => LibraryProblem::NoMineral,
            (actual, _) if actual > MAX_MINERALS => LibraryProblem::TooManyMinerals { actual },
            (_, actual) if !(2..=MAX_BANDS).contains(&actual) => {
                LibraryProblem::BandCount { actual }
            }
            _ => {
                return Header {
                    names,
                    wavelengths_nm,
                }
                .with_minerals_once(line);
            }
        };
        Err(LibraryError::Line { line, problem })
    }

    fn with_minerals_once(self, line: usize) -> Result<Header, LibraryError> {
        let minerals = self.minerals();
        for (i, name) in minerals.iter().enumerate() {
            if minerals[..i].contains(name) {
                return Err(field(line, name, LibraryProblem::DuplicateColumn));
            }
        }
        Ok(self)
    }
}

/// The wavelength of a column `rNNN` \[nm\].
fn wavelength_of(name: &str) -> Option<f64> {
    let digits = name.strip_prefix('r')?;
    let plain = digits
        .bytes()
        .all(|byte| byte.is_ascii_digit() || byte == b'.');
    let begins = digits.bytes().next()?.is_ascii_digit();
    (plain && begins).then(|| digits.parse().ok()).flatten()
}

/// Whether a text can be the name of a mineral.
fn is_name(name: &str) -> bool {
    let mut chars = name.chars();
    chars.next().is_some_and(char::is_alphabetic)
        && name.len() <= 64
        && chars.all(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | ' '))
}

/// The name of a band that a wrong one may have meant: its digits, or else the next band.
fn nearest_band(name: &str, before_nm: &[f64]) -> String {
    let digits: String = name.chars().filter(char::is_ascii_digit).take(6).collect();
    if !digits.is_empty() {
        return format!("r{digits}");
    }
    match before_nm {
        [.., first, last] => format!("r{}", 2.0 * last - first),
        _ => "r450".to_owned(),
    }
}

/// A number from 0 to `most`.
fn number_within(text: &str, most: f64) -> Option<f64> {
    let value: f64 = text.parse().ok()?;
    // Written so that a NaN fails. Adding 0 makes -0 plain.
    (value >= 0.0 && value <= most).then_some(value + 0.0)
}

/// The file as text, without its byte-order mark.
fn text_of(bytes: &[u8]) -> Result<&str, LibraryError> {
    if bytes.len() > MAX_FILE_BYTES {
        return Err(LibraryError::TooLarge {
            limit_bytes: MAX_FILE_BYTES,
            actual_bytes: bytes.len(),
        });
    }
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let before = &bytes[..error.valid_up_to()];
        let newlines = before.iter().filter(|byte| **byte == b'\n').count();
        LibraryError::NotText { line: newlines + 1 }
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// The fields of a line, trimmed and without their quotes, at most `most` and one of them; and how
/// many there are.
fn fields_of(
    line: usize,
    text: &str,
    most: usize,
) -> Result<(Vec<Cow<'_, str>>, usize), LibraryError> {
    let quotes = || {
        let problem = LibraryProblem::Quotes;
        LibraryError::Line { line, problem }
    };
    let (mut fields, mut count) = (Vec::new(), 0);
    let mut rest = Some(text);
    while let Some(text) = rest.take() {
        count += 1;
        let is_kept = fields.len() <= most;
        let Some(quoted) = text.trim_start().strip_prefix('"') else {
            let (plain, after) = text
                .split_once(',')
                .map_or((text, None), |(a, b)| (a, Some(b)));
            if is_kept {
                fields.push(Cow::Borrowed(plain.trim()));
            }
            rest = after;
            continue;
        };
        let end = closing_quote(quoted).ok_or_else(quotes)?;
        if is_kept {
            let text = quoted[..end].replace("\"\"", "\"");
            fields.push(Cow::Owned(text.trim().to_owned()));
        }
        let after = quoted[end + 1..].trim_start();
        match after.strip_prefix(',') {
            Some(next) => rest = Some(next),
            None if after.is_empty() => {}
            None => return Err(quotes()),
        }
    }
    Ok((fields, count))
}

/// Where a quoted field ends: at its first quote that is not doubled.
fn closing_quote(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let mut at = 0;
    loop {
        at += bytes[at..].iter().position(|byte| *byte == b'"')?;
        if bytes.get(at + 1) != Some(&b'"') {
            return Some(at);
        }
        at += 2;
    }
}

fn field(line: usize, column: &str, problem: LibraryProblem) -> LibraryError {
    LibraryError::Field {
        line,
        column: shown(column),
        problem,
    }
}

/// The first 40 characters.
fn shown(text: &str) -> String {
    text.chars().take(40).collect()
}

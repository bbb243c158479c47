//! Expectation maximisation at a fixed number of classes: steps that never lower the objective.

use super::{FitSettings, Mixture, Table, normalise};

/// A run on one table, with the memory that its steps need; nothing is allocated in a step.
pub(super) struct Run<'a> {
    table: &'a Table,
    settings: &'a FitSettings,
    /// The least variance of each column.
    floors: &'a [f64],
    pub(super) mixture: Mixture,
    /// Responsibilities, row by row.
    pub(super) shares: Vec<f64>,
    /// Sums of one class over the rows, for each column.
    weight: Vec<f64>,
    sum: Vec<f64>,
    squares: Vec<f64>,
}

/// The least variance of each column: a share of its variance over all rows.
pub(super) fn floors(table: &Table, settings: &FitSettings) -> Vec<f64> {
    let least = settings.least_spread * settings.least_spread;
    let floor = |column| {
        let variance = table.moments(column).map_or(0.0, |(_, variance)| variance);
        // Of a column that is the same for all rows nothing is learnt, whatever this is.
        (least * variance).max(1.0e-12)
    };
    (0..table.columns()).map(floor).collect()
}

impl<'a> Run<'a> {
    /// A run that begins with these responsibilities.
    pub(super) fn new(
        table: &'a Table,
        settings: &'a FitSettings,
        floors: &'a [f64],
        classes: usize,
        shares: Vec<f64>,
    ) -> Run<'a> {
        let columns = table.columns();
        let mut means = Vec::with_capacity(classes * columns);
        let mut tied = Vec::with_capacity(columns);
        for (column, &floor) in floors.iter().enumerate() {
            let (mean, variance) = table.moments(column).unwrap_or((0.0, 1.0));
            means.push(mean);
            tied.push(variance.max(floor));
        }
        let mixture = Mixture {
            columns,
            position_at: table.position_at(),
            position_weight: settings.position_weight,
            shrinkage: settings.shrinkage,
            weights: vec![1.0 / classes as f64; classes],
            means: means.repeat(classes),
            variances: tied.repeat(classes),
            tied,
        };
        let mut run = Run {
            table,
            settings,
            floors,
            mixture,
            shares,
            weight: vec![0.0; columns],
            sum: vec![0.0; columns],
            squares: vec![0.0; columns],
        };
        // Variances of the whole field would blur the classes that the shares describe, so the tied
        // ones are first those within classes.
        run.maximise();
        run.tie_within();
        run.maximise();
        run
    }

    /// Responsibilities at the present parameters; returns the log-likelihood.
    pub(super) fn expect(&mut self) -> f64 {
        let mut sum = 0.0;
        let classes = self.mixture.classes();
        for (row, shares) in self.shares.chunks_exact_mut(classes).enumerate() {
            let (values, noise) = (self.table.row(row), self.table.noise(row));
            self.mixture.joint(values, noise, shares);
            sum += normalise(shares);
        }
        sum
    }

    /// What is subtracted from the log-likelihood in the objective.
    pub(super) fn penalty(&self) -> f64 {
        let Mixture { columns, tied, .. } = &self.mixture;
        let mut spread = 0.0;
        for variances in self.mixture.variances.chunks_exact(*columns) {
            for (d, (variance, tied)) in variances.iter().zip(tied).enumerate() {
                let ratio = tied / variance;
                spread += self.exponent(d) * 0.5 * (ratio - 1.0 - libm::log(ratio));
            }
        }
        let shares: f64 = self.mixture.weights.iter().map(|&w| libm::log(w)).sum();
        let shares = match self.settings.weight_prior > 0.0 {
            true => self.settings.weight_prior * shares,
            false => 0.0,
        };
        self.settings.shrinkage * spread - shares
    }

    fn exponent(&self, column: usize) -> f64 {
        match column < self.mixture.position_at {
            true => 1.0,
            false => self.mixture.position_weight,
        }
    }

    /// The parameters that are best at the present responsibilities, each given the others.
    pub(super) fn maximise(&mut self) {
        let classes = self.mixture.classes();
        let prior = self.settings.weight_prior;
        let total = self.table.len() as f64 + prior * classes as f64;
        for class in 0..classes {
            let members: f64 = self.shares.iter().skip(class).step_by(classes).sum();
            self.mixture.weights[class] = (members + prior) / total;
            self.maximise_class(class);
        }
        let columns = self.mixture.columns;
        for column in 0..columns {
            let of_classes = self.mixture.variances.iter().skip(column).step_by(columns);
            let inverse: f64 = of_classes.map(|variance| 1.0 / variance).sum();
            self.mixture.tied[column] = classes as f64 / inverse;
        }
    }

    /// Mean and variance of a class. What noise hides of a value is replaced by what the class
    /// expects of it.
    fn maximise_class(&mut self, class: usize) {
        let classes = self.mixture.classes();
        let columns = self.mixture.columns;
        let means = &mut self.mixture.means[class * columns..(class + 1) * columns];
        let variances = &mut self.mixture.variances[class * columns..(class + 1) * columns];
        let (weight, sum) = (&mut self.weight[..], &mut self.sum[..]);
        weight.fill(0.0);
        sum.fill(0.0);
        for row in 0..self.table.len() {
            let share = self.shares[row * classes + class];
            let (values, noise) = (self.table.row(row), self.table.noise(row));
            for d in 0..columns {
                if noise[d] == f64::INFINITY {
                    continue;
                }
                let kept = variances[d] / (variances[d] + noise[d]);
                weight[d] += share;
                sum[d] += share * kept * (values[d] - means[d]);
            }
        }
        // The expectations of both steps are taken at the old mean and variance.
        for d in 0..columns {
            sum[d] = if weight[d] > 1.0e-9 {
                sum[d] / weight[d]
            } else {
                0.0
            };
        }
        let (moved, squares) = (&*sum, &mut self.squares[..]);
        squares.fill(0.0);
        for row in 0..self.table.len() {
            let share = self.shares[row * classes + class];
            let (values, noise) = (self.table.row(row), self.table.noise(row));
            for d in 0..columns {
                if noise[d] == f64::INFINITY {
                    continue;
                }
                let kept = variances[d] / (variances[d] + noise[d]);
                let difference = kept * (values[d] - means[d]) - moved[d];
                squares[d] += share * (difference * difference + kept * noise[d]);
            }
        }
        let shrinkage = self.settings.shrinkage;
        for d in 0..columns {
            means[d] += moved[d];
            let tied = self.mixture.tied[d];
            let variance = (squares[d] + shrinkage * tied) / (weight[d] + shrinkage);
            variances[d] = variance.max(self.floors[d]);
        }
    }

    /// Sets the tied variances to the mean of the classes', weighted by their shares.
    fn tie_within(&mut self) {
        let Mixture {
            columns,
            weights,
            variances,
            tied,
            ..
        } = &mut self.mixture;
        for (d, tied) in tied.iter_mut().enumerate() {
            let of_classes = variances.iter().skip(d).step_by(*columns);
            *tied = of_classes.zip(&*weights).map(|(v, w)| v * w).sum();
        }
    }

    /// Steps until the objective hardly rises, at most `steps`. Returns log-likelihood and objective.
    pub(super) fn climb(&mut self, steps: usize) -> (f64, f64) {
        let mut log_likelihood = self.expect();
        let mut objective = log_likelihood - self.penalty();
        let enough = self.settings.tolerance * self.table.len() as f64;
        for _ in 0..steps {
            self.maximise();
            log_likelihood = self.expect();
            let before = std::mem::replace(&mut objective, log_likelihood - self.penalty());
            if objective - before < enough {
                break;
            }
        }
        (log_likelihood, objective)
    }
}

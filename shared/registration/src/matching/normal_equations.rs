//! Normal equations for the pose of a sweep and the motion during it.

use crate::self_calibration::ring_errors::RingSums;
use nalgebra::{Matrix6, SMatrix, SVector, Vector3, Vector6};

/// Rows and columns of the upper triangle of a symmetric 6 x 6 matrix, column by column.
const TRIANGLE: [(usize, usize); 21] = {
    let mut places = [(0, 0); 21];
    let mut at = 0;
    let mut col = 0;
    while col < 6 {
        let mut row = 0;
        while row <= col {
            places[at] = (row, col);
            at += 1;
            row += 1;
        }
        col += 1;
    }
    places
};

/// Number of unknowns in addition to pose and motion: the ground tilt, the common elevation error of all rings, and the
/// spin direction of a sensor without point times.
pub(crate) const NUISANCES: usize = 3;

/// Sums over residuals r with Jacobian J for the pose (translation, then rotation, both in odom axes about the LiDAR's
/// position) and `s J` for the motion over the sweep, where s is the share of the point.
#[derive(Clone)]
pub(crate) struct NormalEquations {
    /// Sums of w J J^T, w s J J^T and w s^2 J J^T, upper triangles: loops over them vectorize.
    squares: [[f64; 21]; 3],
    /// Sums of w J r and w s J r.
    gradients: [[f64; 6]; 2],
    /// Sums of w J l and w s J l for the derivative l of each nuisance parameter.
    crosses: [[[f64; 6]; 2]; NUISANCES],
    /// Sums of w l m for each pair of nuisance parameters.
    nuisances: [[f64; NUISANCES]; NUISANCES],
    /// Sums of w l r.
    products: [f64; NUISANCES],
    /// Sums per row of the range image.
    pub rings: Vec<RingSums>,
    /// Sum of w.
    pub weight: f64,
    /// Sum of w r^2, m^2.
    pub weighted_squares: f64,
    /// Truncated cost in units of the robust scale: min(1, (r / scale)^2) for each match, 1 for each point without a
    /// match.
    pub cost: f64,
    /// Number of points with a match.
    pub n_matches: usize,
}

impl NormalEquations {
    pub fn zero() -> Self {
        Self {
            squares: [[0.0; 21]; 3],
            gradients: [[0.0; 6]; 2],
            crosses: [[[0.0; 6]; 2]; NUISANCES],
            nuisances: [[0.0; NUISANCES]; NUISANCES],
            products: [0.0; NUISANCES],
            rings: Vec::new(),
            weight: 0.0,
            weighted_squares: 0.0,
            cost: 0.0,
            n_matches: 0,
        }
    }
    /// Adds the residual `r` (m, along `normal`) of a point at `arm` from the LiDAR, odom axes. `levers` are its
    /// derivatives with respect to the nuisance parameters, m.
    #[inline(always)]
    pub fn add(
        &mut self,
        arm: &Vector3<f64>,
        normal: &Vector3<f64>,
        r: f64,
        levers: [f64; NUISANCES],
        weight: f64,
        share: f64,
    ) {
        let torque = arm.cross(normal);
        let j = [normal.x, normal.y, normal.z, torque.x, torque.y, torque.z];
        let wj = j.map(|value| weight * value);
        let mut terms = [0.0; 21];
        for (term, (row, col)) in terms.iter_mut().zip(TRIANGLE) {
            *term = wj[col] * j[row];
        }
        let [pose, cross, motion] = &mut self.squares;
        for (at, term) in terms.into_iter().enumerate() {
            pose[at] += term;
            cross[at] += share * term;
            motion[at] += share * share * term;
        }
        let [pose, motion] = &mut self.gradients;
        for (at, value) in wj.into_iter().enumerate() {
            pose[at] += value * r;
            motion[at] += share * value * r;
        }
        for (k, lever) in levers.into_iter().enumerate() {
            let [pose, motion] = &mut self.crosses[k];
            for (at, value) in wj.into_iter().enumerate() {
                pose[at] += value * lever;
                motion[at] += share * value * lever;
            }
            for (other, sum) in levers.into_iter().zip(&mut self.nuisances[k]) {
                *sum += weight * lever * other;
            }
            self.products[k] += weight * lever * r;
        }
        self.weight += weight;
        self.weighted_squares += weight * r * r;
        self.n_matches += 1;
    }
    /// Adds a feature to the sums of its row.
    #[inline(always)]
    pub fn add_to_ring(&mut self, row: usize, lever: f64, map_lever: f64, r: f64, weight: f64) {
        if row >= self.rings.len() {
            self.rings.resize(row + 1, RingSums::default());
        }
        self.rings[row].add(lever, map_lever, r, weight);
    }
    /// Adds the sums of another part.
    pub fn merge(&mut self, part: &Self) {
        let sums = self.squares.as_flattened_mut().iter_mut().chain(self.gradients.as_flattened_mut());
        let sums = sums.chain(self.crosses.as_flattened_mut().as_flattened_mut());
        let sums = sums.chain(self.nuisances.as_flattened_mut()).chain(&mut self.products);
        let values = part.squares.as_flattened().iter().chain(part.gradients.as_flattened());
        let values = values.chain(part.crosses.as_flattened().as_flattened());
        for (sum, value) in sums.zip(values.chain(part.nuisances.as_flattened()).chain(&part.products)) {
            *sum += value;
        }
        self.rings.resize(self.rings.len().max(part.rings.len()), RingSums::default());
        self.rings.iter_mut().zip(&part.rings).for_each(|(sum, ring)| sum.merge(ring));
        self.weight += part.weight;
        self.weighted_squares += part.weighted_squares;
        self.cost += part.cost;
        self.n_matches += part.n_matches;
    }
    /// Sum of w J J^T.
    pub fn pose(&self) -> Matrix6<f64> {
        symmetric(&self.squares[0])
    }
    /// Steps of pose and motion, and the nuisance parameters, that minimize the cost under a prior on each. Without
    /// `motion_prior` the motion is not an unknown. `None` if the system is singular.
    pub fn solve(
        &self,
        pose_prior: &StepPrior<'_>,
        motion_prior: Option<&StepPrior<'_>>,
        priors: [NuisancePrior; NUISANCES],
    ) -> Option<Solution> {
        /// First row of the nuisance parameters.
        const FIRST: usize = 12;
        let mut h = SMatrix::<f64, { FIRST + NUISANCES }, { FIRST + NUISANCES }>::identity();
        let mut g = SVector::<f64, { FIRST + NUISANCES }>::zeros();
        let (n, blocks) = if motion_prior.is_some() { (FIRST, 2) } else { (6, 1) };
        h.fixed_view_mut::<6, 6>(0, 0).copy_from(&(self.pose() + pose_prior.information));
        g.fixed_rows_mut::<6>(0)
            .copy_from(&(pose_prior.information * pose_prior.step - Vector6::from(self.gradients[0])));
        if let Some(StepPrior { information, step }) = motion_prior {
            let cross = symmetric(&self.squares[1]);
            h.fixed_view_mut::<6, 6>(0, 6).copy_from(&cross);
            h.fixed_view_mut::<6, 6>(6, 0).copy_from(&cross);
            h.fixed_view_mut::<6, 6>(6, 6).copy_from(&(symmetric(&self.squares[2]) + *information));
            g.fixed_rows_mut::<6>(6).copy_from(&(*information * *step - Vector6::from(self.gradients[1])));
        }
        for (k, NuisancePrior { information, expected }) in priors.into_iter().enumerate() {
            for (row, value) in self.crosses[k][..blocks].as_flattened().iter().enumerate().take(n) {
                h[(row, FIRST + k)] = -value;
                h[(FIRST + k, row)] = -value;
            }
            for other in 0..NUISANCES {
                h[(FIRST + k, FIRST + other)] = self.nuisances[k][other];
            }
            h[(FIRST + k, FIRST + k)] += information;
            g[FIRST + k] = self.products[k] + information * expected;
        }
        let cholesky = h.cholesky()?;
        let step = cholesky.solve(&g);
        let nuisances = std::array::from_fn(|k| {
            let mut unit = SVector::<f64, { FIRST + NUISANCES }>::zeros();
            unit[FIRST + k] = 1.0;
            Nuisance { value: step[FIRST + k], cofactor: cholesky.solve(&unit)[FIRST + k] }
        });
        Some(Solution {
            pose: step.fixed_rows::<6>(0).into_owned(),
            motion: step.fixed_rows::<6>(6).into_owned(),
            nuisances,
        })
    }
}

/// Prior of a step of pose or motion: translation (m), then rotation (rad), odom axes.
pub(crate) struct StepPrior<'a> {
    /// Information matrix, in units of the squared error of a residual.
    pub information: &'a Matrix6<f64>,
    /// The step that the prior expects.
    pub step: &'a Vector6<f64>,
}

/// Prior of a nuisance parameter.
#[derive(Clone, Copy)]
pub(crate) struct NuisancePrior {
    /// Information, in units of the squared error of a residual.
    pub information: f64,
    /// The value that the prior expects.
    pub expected: f64,
}

/// An estimated nuisance parameter.
pub(crate) struct Nuisance {
    pub value: f64,
    /// Variance in units of the squared error of a residual.
    pub cofactor: f64,
}

/// See [`NormalEquations::solve`].
pub(crate) struct Solution {
    /// Step of the pose.
    pub pose: Vector6<f64>,
    /// Step of the motion; zero if it is not an unknown.
    pub motion: Vector6<f64>,
    pub nuisances: [Nuisance; NUISANCES],
}

fn symmetric(triangle: &[f64; 21]) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    for ((row, col), value) in TRIANGLE.into_iter().zip(triangle) {
        matrix[(row, col)] = *value;
        matrix[(col, row)] = *value;
    }
    matrix
}

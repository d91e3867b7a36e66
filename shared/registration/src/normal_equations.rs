//! Normal equations for the pose of a sweep and the motion during it.

use nalgebra::{Matrix6, SMatrix, SVector, Vector3, Vector6};

/// Rows and columns of the upper triangle of a symmetric 6 x 6 matrix, column by column.
const TRIANGLE: [(usize, usize); 21] = {
    let mut places = [(0, 0); 21];
    let (mut at, mut col) = (0, 0);
    while col < 6 {
        let mut row = 0;
        while row <= col {
            places[at] = (row, col);
            (at, row) = (at + 1, row + 1);
        }
        col += 1;
    }
    places
};

/// Sums over residuals r with Jacobian J for the pose (translation, then rotation, both in odom axes about the LiDAR's
/// position) and `s J` for the motion over the sweep, s being the share of the point.
#[derive(Clone)]
pub(crate) struct NormalEquations {
    /// Sums of w J J^T, w s J J^T and w s^2 J J^T, upper triangles: a loop over them vectorizes.
    squares: [[f64; 21]; 3],
    /// Sums of w J r and w s J r.
    gradients: [[f64; 6]; 2],
    /// Sum of w.
    pub weight: f64,
    /// Sum of w r^2, m^2.
    pub weighted_squares: f64,
    /// Truncated cost in units of the robust scale: min(1, (r / scale)^2) for each match, 1 for each point without.
    pub cost: f64,
    /// Points with a match.
    pub n_matches: usize,
}

impl NormalEquations {
    pub fn zero() -> Self {
        Self {
            squares: [[0.0; 21]; 3],
            gradients: [[0.0; 6]; 2],
            weight: 0.0,
            weighted_squares: 0.0,
            cost: 0.0,
            n_matches: 0,
        }
    }
    /// Adds the residual `r` (m, along `normal`) of a point at `arm` from the LiDAR, odom axes.
    #[inline(always)]
    pub fn add(&mut self, arm: &Vector3<f64>, normal: &Vector3<f64>, r: f64, weight: f64, share: f64) {
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
        self.weight += weight;
        self.weighted_squares += weight * r * r;
        self.n_matches += 1;
    }
    /// Adds the sums of another part.
    pub fn merge(&mut self, part: &Self) {
        let sums = self.squares.as_flattened_mut().iter_mut().chain(self.gradients.as_flattened_mut());
        for (sum, value) in sums.zip(part.squares.as_flattened().iter().chain(part.gradients.as_flattened())) {
            *sum += value;
        }
        self.weight += part.weight;
        self.weighted_squares += part.weighted_squares;
        self.cost += part.cost;
        self.n_matches += part.n_matches;
    }
    /// Sum of w J J^T.
    pub fn pose(&self) -> Matrix6<f64> {
        symmetric(&self.squares[0])
    }
    /// The step of the pose alone that minimizes the cost; see [`NormalEquations::solve`].
    pub fn solve_pose(&self, (prior, offset): (&Matrix6<f64>, &Vector6<f64>)) -> Option<Vector6<f64>> {
        Some((self.pose() + prior).cholesky()?.solve(&(prior * offset - Vector6::from(self.gradients[0]))))
    }
    /// Steps of pose and motion that minimize the cost under a prior on each: `pose_prior` is an information matrix and
    /// `pose_offset` the step that the prior expects; alike for the motion. `None` if the system is singular.
    pub fn solve(
        &self,
        (pose_prior, pose_offset): (&Matrix6<f64>, &Vector6<f64>),
        (motion_prior, motion_offset): (&Matrix6<f64>, &Vector6<f64>),
    ) -> Option<(Vector6<f64>, Vector6<f64>)> {
        let cross = symmetric(&self.squares[1]);
        let mut h = SMatrix::<f64, 12, 12>::zeros();
        h.fixed_view_mut::<6, 6>(0, 0).copy_from(&(self.pose() + pose_prior));
        h.fixed_view_mut::<6, 6>(0, 6).copy_from(&cross);
        h.fixed_view_mut::<6, 6>(6, 0).copy_from(&cross);
        h.fixed_view_mut::<6, 6>(6, 6).copy_from(&(symmetric(&self.squares[2]) + motion_prior));
        let mut g = SVector::<f64, 12>::zeros();
        g.fixed_rows_mut::<6>(0).copy_from(&(pose_prior * pose_offset - Vector6::from(self.gradients[0])));
        g.fixed_rows_mut::<6>(6).copy_from(&(motion_prior * motion_offset - Vector6::from(self.gradients[1])));
        let step = h.cholesky()?.solve(&g);
        Some((step.fixed_rows::<6>(0).into_owned(), step.fixed_rows::<6>(6).into_owned()))
    }
}

fn symmetric(triangle: &[f64; 21]) -> Matrix6<f64> {
    let mut matrix = Matrix6::zeros();
    for ((row, col), value) in TRIANGLE.into_iter().zip(triangle) {
        matrix[(row, col)] = *value;
        matrix[(col, row)] = *value;
    }
    matrix
}

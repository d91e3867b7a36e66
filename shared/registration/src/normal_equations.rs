//! Least squares over the pose of a sweep and the motion during it.

use nalgebra::{Matrix6, SMatrix, SVector, Vector3, Vector6};

/// Sums over residuals r with Jacobian J for the pose (translation, then rotation, both in odom axes about the lidar's
/// position) and `s J` for the motion over the sweep, s being the share of the point.
#[derive(Clone)]
pub(crate) struct NormalEquations {
    /// Sum of w J J^T.
    pub pose: Matrix6<f64>,
    /// Sum of w s J J^T.
    pub cross: Matrix6<f64>,
    /// Sum of w s^2 J J^T.
    pub motion: Matrix6<f64>,
    /// Sum of w J r.
    pub pose_gradient: Vector6<f64>,
    /// Sum of w s J r.
    pub motion_gradient: Vector6<f64>,
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
            pose: Matrix6::zeros(),
            cross: Matrix6::zeros(),
            motion: Matrix6::zeros(),
            pose_gradient: Vector6::zeros(),
            motion_gradient: Vector6::zeros(),
            weight: 0.0,
            weighted_squares: 0.0,
            cost: 0.0,
            n_matches: 0,
        }
    }
    /// Adds the residual `r` (m, along `normal`) of a point at `arm` from the lidar, odom axes.
    #[inline]
    pub fn add(&mut self, arm: &Vector3<f64>, normal: &Vector3<f64>, r: f64, weight: f64, share: f64) {
        let turn = arm.cross(normal);
        let j = [normal.x, normal.y, normal.z, turn.x, turn.y, turn.z];
        for col in 0..6 {
            let wj = weight * j[col];
            let swj = share * wj;
            self.pose_gradient[col] += wj * r;
            self.motion_gradient[col] += swj * r;
            // The upper triangle; `mirror` fills the rest once.
            for (row, other) in j.iter().enumerate().take(col + 1) {
                let term = wj * other;
                self.pose[(row, col)] += term;
                self.cross[(row, col)] += share * term;
                self.motion[(row, col)] += share * share * term;
            }
        }
        self.weight += weight;
        self.weighted_squares += weight * r * r;
        self.n_matches += 1;
    }
    /// Adds another part's sums.
    pub fn merge(&mut self, part: &Self) {
        self.pose += part.pose;
        self.cross += part.cross;
        self.motion += part.motion;
        self.pose_gradient += part.pose_gradient;
        self.motion_gradient += part.motion_gradient;
        self.weight += part.weight;
        self.weighted_squares += part.weighted_squares;
        self.cost += part.cost;
        self.n_matches += part.n_matches;
    }
    /// Copies the upper triangles to the lower ones.
    pub fn mirror(&mut self) {
        self.pose.fill_lower_triangle_with_upper_triangle();
        self.cross.fill_lower_triangle_with_upper_triangle();
        self.motion.fill_lower_triangle_with_upper_triangle();
    }
    /// The step of the pose alone that lowers the cost most; see [`NormalEquations::solve`].
    pub fn solve_pose(&self, (prior, offset): (&Matrix6<f64>, &Vector6<f64>)) -> Option<Vector6<f64>> {
        Some((self.pose + prior).cholesky()?.solve(&(prior * offset - self.pose_gradient)))
    }
    /// Steps of pose and motion that lower the cost most, under a prior on each: `pose_prior` is an information matrix
    /// and `pose_offset` the step that it wants; alike for the motion. `None` if the system is singular.
    pub fn solve(
        &self,
        (pose_prior, pose_offset): (&Matrix6<f64>, &Vector6<f64>),
        (motion_prior, motion_offset): (&Matrix6<f64>, &Vector6<f64>),
    ) -> Option<(Vector6<f64>, Vector6<f64>)> {
        let mut h = SMatrix::<f64, 12, 12>::zeros();
        h.fixed_view_mut::<6, 6>(0, 0).copy_from(&(self.pose + pose_prior));
        h.fixed_view_mut::<6, 6>(0, 6).copy_from(&self.cross);
        h.fixed_view_mut::<6, 6>(6, 0).copy_from(&self.cross);
        h.fixed_view_mut::<6, 6>(6, 6).copy_from(&(self.motion + motion_prior));
        let mut g = SVector::<f64, 12>::zeros();
        g.fixed_rows_mut::<6>(0).copy_from(&(pose_prior * pose_offset - self.pose_gradient));
        g.fixed_rows_mut::<6>(6).copy_from(&(motion_prior * motion_offset - self.motion_gradient));
        let step = h.cholesky()?.solve(&g);
        Some((step.fixed_rows::<6>(0).into_owned(), step.fixed_rows::<6>(6).into_owned()))
    }
}

//! Numeric outlines of bodies: length, width and height profile of each kind of vehicle, with windows, posts and axles.

/// Measures of a kind of car, m. Lists go from back to front.
pub struct Body {
    /// x, height of the shoulder under the windows, half width.
    pub outline: &'static [[f32; 3]],
    /// x of foot and head of the rear window, then of head and foot of the windscreen.
    pub cabin: [f32; 4],
    /// Height and half width of the roof.
    pub roof: [f32; 2],
    /// Range of x in which the sides have windows.
    pub glazed: [f32; 2],
    /// x of the window posts.
    pub posts: &'static [f32],
    pub axles: &'static [f32],
    pub wheel: f32,
    /// Height of the body above the ground.
    pub clearance: f32,
}

pub const HATCHBACK: Body = Body {
    outline: &[
        [-1.95, 0.80, 0.72],
        [-1.90, 0.93, 0.82],
        [-1.20, 0.97, 0.88],
        [0.85, 0.95, 0.88],
        [1.55, 0.86, 0.84],
        [1.90, 0.70, 0.74],
        [1.98, 0.55, 0.66],
    ],
    cabin: [-1.90, -1.55, 0.05, 1.00],
    roof: [1.47, 0.58],
    glazed: [-1.45, 0.85],
    posts: &[-0.62],
    axles: &[-1.22, 1.26],
    wheel: 0.31,
    clearance: 0.19,
};

pub const SALOON: Body = Body {
    outline: &[
        [-2.30, 0.72, 0.74],
        [-2.24, 0.94, 0.82],
        [-1.50, 1.00, 0.89],
        [0.80, 0.96, 0.90],
        [1.80, 0.84, 0.85],
        [2.22, 0.68, 0.74],
        [2.30, 0.54, 0.66],
    ],
    cabin: [-1.75, -1.15, 0.05, 0.95],
    roof: [1.43, 0.57],
    glazed: [-1.50, 0.80],
    posts: &[-0.50],
    axles: &[-1.38, 1.40],
    wheel: 0.32,
    clearance: 0.18,
};

pub const ESTATE: Body = Body {
    outline: SALOON.outline,
    cabin: [-2.22, -1.90, 0.05, 0.95],
    roof: [1.47, 0.60],
    glazed: [-1.95, 0.80],
    posts: &[-0.50, -1.35],
    ..SALOON
};

pub const SUV: Body = Body {
    outline: &[
        [-2.22, 0.95, 0.80],
        [-2.16, 1.08, 0.88],
        [-1.40, 1.12, 0.93],
        [0.75, 1.10, 0.94],
        [1.75, 1.02, 0.90],
        [2.18, 0.86, 0.80],
        [2.26, 0.66, 0.72],
    ],
    cabin: [-2.10, -1.80, 0.05, 0.85],
    roof: [1.70, 0.64],
    glazed: [-1.85, 0.72],
    posts: &[-0.50, -1.35],
    axles: &[-1.34, 1.38],
    wheel: 0.36,
    clearance: 0.26,
};

pub const CITY_CAR: Body = Body {
    outline: &[
        [-1.45, 0.85, 0.70],
        [-1.40, 0.98, 0.76],
        [-0.60, 1.02, 0.80],
        [0.75, 0.98, 0.80],
        [1.30, 0.86, 0.76],
        [1.47, 0.60, 0.64],
    ],
    cabin: [-1.38, -1.05, 0.20, 0.95],
    roof: [1.54, 0.58],
    glazed: [-1.00, 0.80],
    posts: &[-0.45],
    axles: &[-0.95, 0.98],
    wheel: 0.28,
    clearance: 0.18,
};

pub const VAN: Body = Body {
    outline: &[
        [-2.70, 1.20, 0.96],
        [-2.66, 1.25, 0.99],
        [1.30, 1.25, 1.00],
        [1.75, 1.15, 0.98],
        [2.45, 0.98, 0.92],
        [2.66, 0.62, 0.84],
    ],
    cabin: [-2.68, -2.60, 1.00, 1.85],
    roof: [2.35, 0.88],
    glazed: [0.72, 1.55],
    posts: &[],
    axles: &[-1.62, 1.70],
    wheel: 0.34,
    clearance: 0.24,
};

pub const MINIBUS: Body = Body { glazed: [-2.50, 1.55], posts: &[-1.75, -0.75, 0.30], roof: [2.05, 0.86], ..VAN };

pub const BUS: Body = Body {
    outline: &[[-6.0, 1.05, 1.22], [-5.9, 1.15, 1.26], [5.85, 1.05, 1.27], [6.0, 0.95, 1.22]],
    cabin: [-5.98, -5.85, 5.70, 5.98],
    roof: [2.95, 1.18],
    glazed: [-5.60, 5.60],
    posts: &[-4.30, -2.90, -1.50, -0.10, 1.30, 2.70, 4.10],
    axles: &[-3.10, 3.20],
    wheel: 0.48,
    clearance: 0.30,
};

pub const TRUCK_CAB: Body = Body {
    outline: &[[1.90, 1.60, 1.15], [1.95, 1.65, 1.20], [3.55, 1.60, 1.22], [3.70, 1.50, 1.15]],
    cabin: [1.92, 1.97, 3.30, 3.68],
    roof: [2.85, 1.10],
    glazed: [2.30, 3.50],
    posts: &[],
    axles: &[2.75],
    wheel: 0.48,
    clearance: 0.40,
};

pub const TRAM: Body = Body {
    outline: &[[-12.0, 1.05, 1.00], [-11.2, 1.15, 1.20], [11.2, 1.15, 1.20], [12.0, 1.05, 1.00]],
    cabin: [-11.98, -11.2, 11.2, 11.98],
    roof: [3.35, 1.12],
    glazed: [-11.0, 11.0],
    posts: &[-9.2, -7.4, -5.6, -3.8, -2.0, 2.0, 3.8, 5.6, 7.4, 9.2],
    axles: &[],
    wheel: 0.30,
    clearance: 0.16,
};

/// One cross section of a body, as y and z: from the sill over the widest position and the shoulder to the edge of the
/// roof.
pub struct Section {
    pub x: f32,
    pub ring: [[f32; 2]; 4],
}

impl Body {
    pub fn ends(&self) -> [f32; 2] {
        [self.outline[0][0], self.outline[self.outline.len() - 1][0]]
    }
    /// Shoulder height and half width at x.
    pub fn at(&self, x: f32) -> [f32; 2] {
        let after = self.outline.partition_point(|o| o[0] <= x).clamp(1, self.outline.len() - 1);
        let [x0, z0, w0] = self.outline[after - 1];
        let [x1, z1, w1] = self.outline[after];
        let share = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
        [z0 + share * (z1 - z0), w0 + share * (w1 - w0)]
    }
    /// Height of the lower edge of the body: the clearance, rounded over the wheels.
    pub fn sill(&self, x: f32) -> f32 {
        let arch = self.wheel + 0.06;
        self.axles.iter().fold(self.clearance, |sill, axle| {
            let off2 = arch * arch - (x - axle) * (x - axle);
            if off2 > 0.0 { sill.max(self.wheel + off2.sqrt()) } else { sill }
        })
    }
    pub fn section(&self, x: f32) -> Section {
        let [shoulder, half] = self.at(x);
        let [rear, rear_head, front_head, front] = self.cabin;
        let share = ((x - rear) / (rear_head - rear)).min((front - x) / (front - front_head)).clamp(0.0, 1.0);
        let [roof, roof_half] = self.roof;
        let sill = self.sill(x).min(shoulder - 0.05);
        let base = half - 0.06;
        let top = [base + share * (roof_half - base), shoulder + share * (roof - shoulder)];
        let widest = sill + 0.55 * (shoulder - sill);
        Section { x, ring: [[half - 0.07, sill], [half, widest], [base, shoulder], top] }
    }
    /// x of all positions where the outline changes.
    pub fn stations(&self) -> Vec<f32> {
        let arch = self.wheel + 0.06;
        let arches =
            self.axles.iter().flat_map(|axle| [-1.0, -0.93, -0.55, 0.55, 0.93, 1.0].map(|share| axle + share * arch));
        let mut xs: Vec<f32> =
            self.outline.iter().map(|o| o[0]).chain(self.cabin).chain(self.glazed).chain(arches).collect();
        let [rear, front] = self.ends();
        xs.retain(|x| (rear..=front).contains(x));
        xs.sort_by(f32::total_cmp);
        xs.dedup_by(|a, b| (*a - *b).abs() < 0.012);
        xs
    }
}

use crate::clouds::awkward;
use neighbors::{SpatialIndex, VoxelGrid};

#[test]
fn results_are_equal_for_one_and_two_threads() {
    let points = awkward(60_000, 9);
    let results = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("threads");
        pool.install(|| {
            let index = SpatialIndex::new(&points);
            let nearest = index.nearest_of_own(8);
            let within = index.within_of_own(1e-3);
            let lists = (0..points.len())
                .map(|i| (nearest.get(i).to_vec(), within.get(i).len(), within.get(i).first().copied()));
            let mapped =
                index.map_within_of_own(1e-3, |point_idx, found| (point_idx, found.len(), found.last().copied()));
            let voxels = VoxelGrid::new(&points, 0.1).expect("a valid cell");
            (index.order().to_vec(), lists.collect::<Vec<_>>(), mapped, index.farthest_points(100, 1), voxels)
        })
    };
    let one = results(1);
    let two = results(2);
    assert!(one == two, "the number of threads changes a result");
}

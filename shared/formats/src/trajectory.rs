//! Trajectories as text: TUM and KITTI.

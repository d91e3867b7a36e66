//! Models and their networks.

mod image_networks;
mod model_files;
mod point_gradients;
mod point_model;
mod point_networks;
mod point_spheres;
mod real_street;
mod sloped_street;
mod spherical_model;
mod support;
mod torch_weights;

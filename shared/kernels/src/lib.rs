//! Fast tensor operations for networks, as custom operations of candle on a CPU.
//!
//! | module | tensors | operations |
//! |---|---|---|
//! | [`images`] | images in blocks of 16 channels, with borders | direct and Winograd convolution, max pooling, upsampling |
//! | [`points`] | a row for each point, a column for each channel | linear layers, normalization, sums and maxima over neighbors, kernel point convolution, convolution on planes |
//!
//! A network is a graph of candle tensors (crate `segmentation`); operations of candle that are fast enough are used
//! directly. This crate contains an operation if candle's own is several times slower on a CPU, or if candle does not
//! have it. The operations on points have their derivatives here, because candle calls both through one trait. The
//! derivatives of convolutions are in the crate `training`: inference does not need them.
//!
//! The result of a kernel never depends on the number of threads, the instruction set or the order in which threads
//! finish: a row or an image is computed by one thread, sums have fixed parts, and every instruction set adds in the
//! same order. Therefore the same input gives the same bytes on every machine. A kernel never reads files, settings,
//! clocks or class names, and never allocates memory that the caller can provide: outputs of convolutions are written
//! to existing tensors.
//!
//! Where to start reading: [`images::convolve`] selects a kernel; `images/direct.rs` is the simplest complete kernel. On points, start with
//! [`points::linear`], then `points/product.rs`, the matrix product that most operations share.

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod images;
pub mod points;

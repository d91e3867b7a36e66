//! Compute device of networks.

use crate::SegmentationError;
use candle_core::Device;

settings::words! {
    /// Compute device of networks.
    #[derive(Default)]
    pub enum ComputeDevice {
        /// The kernels of [`kernels::images`] on all threads of the CPU.
        #[default]
        Cpu = "cpu",
        /// The operations of candle on the first NVIDIA GPU, in a build with the feature `cuda`.
        Cuda = "cuda",
    }
}

impl ComputeDevice {
    /// The candle device that runs the networks; `None` for the kernels.
    ///
    /// # Errors
    /// If this build cannot use the device, or the machine does not have it.
    pub fn open(self) -> Result<Option<Device>, SegmentationError> {
        match self {
            Self::Cpu => Ok(None),
            Self::Cuda if candle_core::utils::cuda_is_available() => {
                Device::new_cuda(0).map(Some).map_err(|error| SegmentationError::NoGpu(error.to_string()))
            }
            Self::Cuda => Err(SegmentationError::BuiltWithoutCuda),
        }
    }
}

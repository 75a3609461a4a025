//! Differences between images: RMSE, PSNR, SSIM and their scale-aligned twins.

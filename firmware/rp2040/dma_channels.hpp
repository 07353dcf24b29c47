// SPDX-License-Identifier: BSD-3-Clause
// Use of the DMA channels.
#pragma once

namespace versavis::rp2040 {

enum DmaUse : unsigned {
    dma_edges0 = 0,  ///< and dma_edges1 go on with each other's ring
    dma_edges1 = 1,
    dma_spi_transmit = 2,
    dma_spi_receive = 3,
};

}  // namespace versavis::rp2040

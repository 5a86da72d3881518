//! What the example programs share: scene sources, camera walks, pictures.

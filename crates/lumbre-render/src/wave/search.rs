//! The closest hits of all rays of a wave.

use lumbre_scene::Scene;

use crate::wave::Wave;

impl Wave<'_> {
    /// Finds what every ray meets.
    pub(super) fn search(&mut self, scene: &Scene) {
        self.collect_rays();
        scene.closest_batch(&self.rays, &mut self.hits);
    }

    /// Finds what rays from the camera meet.
    pub(super) fn search_seen(&mut self, scene: &Scene) {
        self.collect_rays();
        scene.closest_seen_batch(&self.rays, &mut self.hits);
    }

    fn collect_rays(&mut self) {
        let Self { rays, paths, slots, hits, .. } = self;
        rays.clear();
        rays.extend(
            (0..paths.len).map(|path| paths.ray(path, slots.camera[paths.slot[path] as usize].ray.time)),
        );
        hits.resize(paths.len, None);
    }
}

#!/bin/bash
# An array job for Slurm that bakes 64 shards, and a job that assembles them:
#   id=$(sbatch --parsable slurm.sh model.glb level)
#   sbatch --dependency=afterok:$id --array=0 slurm.sh model.glb level assemble
# The current folder must be one that all machines share. Settings of the bake must be the same in both.
#SBATCH --array=0-63
#SBATCH --cpus-per-task=4
#SBATCH --requeue
set -euo pipefail
COUNT=64
scene=$1 name=$2 settings=(--size 4,4,2 --gap 5%)
if [[ ${3:-} == assemble ]]; then
    exec bake assemble "$scene" "${settings[@]}" -o "$name.pvs" --shards "$name".shards/*.shard
fi
INDEX=$SLURM_ARRAY_TASK_ID
mkdir -p "$name.shards"
# A shard that was interrupted goes on from the file that it has left beside its own.
[[ -e $name.shards/$INDEX.shard ]] ||
    exec bake "$scene" "${settings[@]}" --shard "$INDEX/$COUNT" --threads 4 -o "$name.shards/$INDEX.shard"

#!/bin/bash
# Workers on a Slurm cluster: `sbatch docs/deploy/slurm.sh`.
#
# An array of independent tasks: nodes come and go one by one, and the campaign goes on with those
# that are there.
#SBATCH --job-name=tracktwin
#SBATCH --array=1-50
#SBATCH --cpus-per-task=16
#SBATCH --mem-per-cpu=500M
#SBATCH --time=04:00:00
# Told to end ten seconds before it is killed: what has begun is finished, the rest handed back.
#SBATCH --signal=B:TERM@20
# A node that fails takes nothing with it; its task is put into the queue again.
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=tracktwin-%A_%a.log
set -u

: "${TRACKTWIN_COORDINATOR:?address of the coordinator, such as https://head:7700}"
export TRACKTWIN_CORES="$SLURM_CPUS_PER_TASK"

# In the background, so that the shell can pass the signal on.
tracktwin-worker --tls-ca "${CERTS:-$HOME/certs}/ca.pem" --token-file "${CERTS:-$HOME/certs}/token" \
    --idle-exit 300 --give-up-after 1800 &
worker=$!
trap 'kill -TERM "$worker"' TERM
wait "$worker"
code=$?
# Interrupted by the signal: wait for the worker's own end.
if kill -0 "$worker" 2>/dev/null; then wait "$worker"; code=$?; fi

# 3 may pass (no coordinator for half an hour); 0 and 2 are not to be tried again.
if [ "$code" -eq 3 ]; then scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"; fi
exit "$code"

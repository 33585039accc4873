-- The views of a library on a server: what people ask, and what the program reads by. The numbered migrations make
-- tables; the views that 0001 to 0008 made as well are replaced by these.
--
-- Opening a library makes them anew where the comment on the schema's view `campaign_status` says a smaller version
-- than here: whoever changes a view raises the number below and in coordinator/library/src/engine/views.rs. A
-- migration that changes a table drops the views that read it; they are made again after it.
--
-- Views are replaced and not dropped, so that who may read them stays who may, and views of others that read them
-- stay. So a new column comes last; another order needs `drop view` before `create view`.
--
-- Columns of parameters are those of the catalogue, in its order; a test compares them. What differs from SQLite:
-- `result` is a view of two tables here (docs/decisions/0030 and 0035), sums of integers are cast, for they are
-- `numeric`, and numbers of a series are read by a function.

-- One row a case and speed: what came out. Series are looked up one by one, and only where they are asked for.
create or replace view result as
select
    campaign_id,
    sobol_index,
    speed_km_h,
    (select log_power from case_series
        where case_series.result_id = case_result.id and case_series.speed_km_h = passes.speed_km_h) as log_power,
    levels_dB[20 * pass - 19] as level_50_Hz_dB,
    levels_dB[20 * pass - 18] as level_63_Hz_dB,
    levels_dB[20 * pass - 17] as level_80_Hz_dB,
    levels_dB[20 * pass - 16] as level_100_Hz_dB,
    levels_dB[20 * pass - 15] as level_125_Hz_dB,
    levels_dB[20 * pass - 14] as level_160_Hz_dB,
    levels_dB[20 * pass - 13] as level_200_Hz_dB,
    levels_dB[20 * pass - 12] as level_250_Hz_dB,
    levels_dB[20 * pass - 11] as level_315_Hz_dB,
    levels_dB[20 * pass - 10] as level_400_Hz_dB,
    levels_dB[20 * pass - 9] as level_500_Hz_dB,
    levels_dB[20 * pass - 8] as level_630_Hz_dB,
    levels_dB[20 * pass - 7] as level_800_Hz_dB,
    levels_dB[20 * pass - 6] as level_1000_Hz_dB,
    levels_dB[20 * pass - 5] as level_1250_Hz_dB,
    levels_dB[20 * pass - 4] as level_1600_Hz_dB,
    levels_dB[20 * pass - 3] as level_2000_Hz_dB,
    levels_dB[20 * pass - 2] as level_2500_Hz_dB,
    levels_dB[20 * pass - 1] as level_3150_Hz_dB,
    levels_dB[20 * pass] as level_4000_Hz_dB,
    duration_s,
    worker,
    code_version,
    model_hash,
    experiment_hash,
    parameter_hash,
    finished_at,
    flagged,
    contact_loss_shares[pass] as contact_loss_share,
    checksum
from case_result
cross join lateral (
    select speed_km_h, cast(place as integer) as pass
    from unnest(speeds_km_h) with ordinality as of (speed_km_h, place)) as passes;

-- One row a case and speed: what went in, and what came out.
create or replace view result_with_parameters as
select
    result.campaign_id,
    result.sobol_index,
    result.speed_km_h,
    campaign_case.railpad_stiffness_N_m,
    campaign_case.railpad_damping_N_s_m,
    campaign_case.ballast_stiffness_N_m,
    campaign_case.ballast_damping_N_s_m,
    campaign_case.sleeper_EI_N_m2,
    campaign_case.irregularity_level,
    campaign_case.surface_seed,
    result.level_50_Hz_dB,
    result.level_63_Hz_dB,
    result.level_80_Hz_dB,
    result.level_100_Hz_dB,
    result.level_125_Hz_dB,
    result.level_160_Hz_dB,
    result.level_200_Hz_dB,
    result.level_250_Hz_dB,
    result.level_315_Hz_dB,
    result.level_400_Hz_dB,
    result.level_500_Hz_dB,
    result.level_630_Hz_dB,
    result.level_800_Hz_dB,
    result.level_1000_Hz_dB,
    result.level_1250_Hz_dB,
    result.level_1600_Hz_dB,
    result.level_2000_Hz_dB,
    result.level_2500_Hz_dB,
    result.level_3150_Hz_dB,
    result.level_4000_Hz_dB,
    result.log_power,
    result.duration_s,
    result.worker,
    result.code_version,
    result.model_hash,
    result.experiment_hash,
    result.parameter_hash,
    result.finished_at,
    result.flagged,
    result.contact_loss_share,
    result.checksum,
    campaign_case.drawn
from result
join campaign_case using (campaign_id, sobol_index);

-- One row a case, speed and frequency bin: ln LWPS, in (m/s2)^2. It reads each number where it is stored.
create or replace view spectrum as
select
    case_result.campaign_id,
    case_result.sobol_index,
    case_series.speed_km_h,
    frequency_bin.bin,
    frequency_bin.frequency_Hz,
    double_at(case_series.log_power, frequency_bin.bin + 1) as log_power
from case_result
join case_series on case_series.result_id = case_result.id
join frequency_bin using (experiment_hash);

-- One row a campaign: how far it is.
create or replace view campaign_status as
select
    campaign.id as campaign_id,
    campaign.name,
    campaign.state,
    campaign.priority,
    cast(coalesce(sum(case_count.cases), 0) as bigint) as cases,
    cast(coalesce(sum(case_count.cases) filter (where case_count.state = 'waiting'), 0) as bigint) as waiting,
    cast(coalesce(sum(case_count.cases) filter (where case_count.state = 'leased'), 0) as bigint) as leased,
    cast(coalesce(sum(case_count.cases) filter (where case_count.state = 'finished'), 0) as bigint) as finished,
    cast(coalesce(sum(case_count.cases) filter (where case_count.state = 'failed'), 0) as bigint) as failed,
    campaign.created_at
from campaign
left join case_count on case_count.campaign_id = campaign.id
group by campaign.id;

-- Cases that were given up, what they were, and why.
create or replace view failed_case as
select
    campaign_id,
    sobol_index,
    railpad_stiffness_N_m,
    railpad_damping_N_s_m,
    ballast_stiffness_N_m,
    ballast_damping_N_s_m,
    sleeper_EI_N_m2,
    irregularity_level,
    surface_seed,
    attempts,
    worker,
    error
from campaign_case
where state = 'failed';

-- Cases finished and failed in each interval of ten seconds, over all coordinators.
create or replace view campaign_progress as
select
    campaign_id,
    from_unix_s,
    cast(sum(finished) as bigint) as finished,
    cast(sum(failed) as bigint) as failed,
    sum(busy_s) as busy_s
from progress
group by campaign_id, from_unix_s;

comment on view campaign_status is 'views of version 2';

-- A case's results lie in one row, all its passes together: what is the same for them (who computed the
-- case, with what, when) is stored once, its case is looked for once, and its series are cut into fewer
-- pieces. `result` shows a row a case and speed as before, in the same columns as with SQLite.

create table case_result (
    campaign_id text collate "C" not null,
    sobol_index bigint not null,
    -- Ascending; the passes stand in this order in levels and series.
    speeds_km_h double precision[] not null,
    -- One-third-octave levels of 50 to 4000 Hz in dB, 20 a pass.
    levels_dB double precision[] not null,
    -- ln LWPS, big-endian doubles, as many a pass as the experiment has frequency bins.
    log_power bytea not null,
    -- Computing time of the case at all speeds together.
    duration_s double precision not null,
    worker text collate "C" not null,
    code_version text collate "C" not null,
    model_hash text collate "C" not null,
    experiment_hash text collate "C" not null,
    parameter_hash text collate "C" not null,
    finished_at text collate "C" not null,
    -- Why a result is doubted; null for most.
    flagged text collate "C",
    constraint a_case_has_one_row_of_results primary key (campaign_id, sobol_index),
    constraint results_belong_to_a_case foreign key (campaign_id, sobol_index)
        references campaign_case (campaign_id, sobol_index),
    constraint every_pass_has_its_levels check (
        cardinality(speeds_km_h) > 0 and cardinality(levels_dB) = 20 * cardinality(speeds_km_h)),
    constraint every_pass_has_as_many_bins check (
        length(log_power) % (8 * cardinality(speeds_km_h)) = 0)
);

-- Doubles don't compress: trying would only cost time.
alter table case_result alter column log_power set storage external;

insert into case_result (campaign_id, sobol_index, speeds_km_h, levels_dB, log_power, duration_s, worker,
    code_version, model_hash, experiment_hash, parameter_hash, finished_at, flagged)
select
    campaign_id,
    sobol_index,
    speeds_km_h,
    array(select level from unnest(levels) with ordinality as of (level, place) order by place),
    log_power,
    duration_s,
    worker,
    code_version,
    model_hash,
    experiment_hash,
    parameter_hash,
    finished_at,
    flagged
from (
    select
        campaign_id,
        sobol_index,
        array_agg(speed_km_h order by speed_km_h) as speeds_km_h,
        array_agg(array[
            level_50_Hz_dB, level_63_Hz_dB, level_80_Hz_dB, level_100_Hz_dB, level_125_Hz_dB,
            level_160_Hz_dB, level_200_Hz_dB, level_250_Hz_dB, level_315_Hz_dB, level_400_Hz_dB,
            level_500_Hz_dB, level_630_Hz_dB, level_800_Hz_dB, level_1000_Hz_dB, level_1250_Hz_dB,
            level_1600_Hz_dB, level_2000_Hz_dB, level_2500_Hz_dB, level_3150_Hz_dB, level_4000_Hz_dB
        ] order by speed_km_h) as levels,
        string_agg(log_power, ''::bytea order by speed_km_h) as log_power,
        max(duration_s) as duration_s,
        max(worker) as worker,
        max(code_version) as code_version,
        max(model_hash) as model_hash,
        max(experiment_hash) as experiment_hash,
        max(parameter_hash) as parameter_hash,
        max(finished_at) as finished_at,
        max(flagged) as flagged
    from result
    group by campaign_id, sobol_index) as gathered;

drop view spectrum;
drop view result_with_parameters;
drop table result;

-- One row a case and speed: what came out.
create view result as
select
    campaign_id,
    sobol_index,
    speed_km_h,
    substring(log_power from bytes * (pass - 1) + 1 for bytes) as log_power,
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
    flagged
from case_result
cross join lateral (
    select speed_km_h, cast(place as integer) as pass,
        length(log_power) / cardinality(speeds_km_h) as bytes
    from unnest(speeds_km_h) with ordinality as of (speed_km_h, place)) as passes;

-- One row a case and speed: what went in, and what came out.
create view result_with_parameters as
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
    result.flagged
from result
join campaign_case using (campaign_id, sobol_index);

-- One row a case, speed and frequency bin: ln LWPS, in (m/s2)^2. It reads each number where it is stored.
create view spectrum as
select
    case_result.campaign_id,
    case_result.sobol_index,
    passes.speed_km_h,
    frequency_bin.bin,
    frequency_bin.frequency_Hz,
    double_at(case_result.log_power, bins * (passes.place - 1) + frequency_bin.bin + 1) as log_power
from case_result
cross join lateral (
    select speed_km_h, place, length(log_power) / cardinality(speeds_km_h) / 8 as bins
    from unnest(speeds_km_h) with ordinality as of (speed_km_h, place)) as passes
join frequency_bin using (experiment_hash);
